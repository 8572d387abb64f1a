// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "dynslam/concepts/map.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/semantic/map_query.hpp"

// Where the ground is in a map: the floor that a robot drives on, and the frame of a planner on it.

namespace dynslam {

/// A plane that has a side which is up.
struct GroundPlane {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();  ///< unit normal, in the map's frame
  double origin_height = 0;                      ///< of the map's origin above the plane [m]
  double share = 0;                              ///< of the occupied voxels that lie on it

  /// Height of a point of the map above the plane [m].
  [[nodiscard]] double height(const Eigen::Vector3d& p) const { return up.dot(p) + origin_height; }
};

/// Options of fit_ground_plane.
struct GroundPlaneOptions {
  Eigen::Vector3d up =
      -Eigen::Vector3d::UnitY();  ///< about; any length. That of an upright camera: y is down
  double max_tilt = 0.8;    ///< angle between `up` and the plane's normal [rad]: hand-held cameras look down
  double max_turn = 0.35;   ///< between the normals of the plane and of the surface at a voxel on it [rad]
  double min_share = 0.03;  ///< of the occupied voxels that lie on a floor
  double max_below =
      0.03;  ///< share of the occupied voxels that may lie below a floor: noise and reflections
  std::size_t max_points = 20000;  ///< occupied voxels that are looked at, evenly drawn from all
  SamplingOptions<double> sampling{.max_iterations = 1000};
};

namespace detail {
/// Where a surface passes, and its unit normal of either sign; zero where it has none.
struct SurfacePoint {
  Eigen::Vector3d centre, normal;
};

/// Least-squares plane of points (total least squares): its normal is their direction of least scatter.
/// @return centre and normal; without a normal where the points have no two directions
template <class Points, class Centre>
[[nodiscard]] SurfacePoint plane_of_points(const Points& points, Centre&& centre) {
  SurfacePoint out{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  if (points.size() < 3) return out;
  for (const auto& p : points) out.centre += centre(p);
  out.centre /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& p : points) {
    const Eigen::Vector3d d = centre(p) - out.centre;
    scatter += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  if (eigen.eigenvalues()(1) > 4 * eigen.eigenvalues()(0)) out.normal = eigen.eigenvectors().col(0);
  return out;
}

/// The surface at an occupied voxel, by the occupied ones of the 5 x 5 x 5 around it.
template <VoxelMap M>
[[nodiscard]] Eigen::Vector3d surface_normal(const M& map, const Eigen::Vector3d& centre,
                                             std::vector<Eigen::Vector3d>& around) {
  around.clear();
  const double edge = map.grid().resolution();
  for (int k = 0; k < 125; ++k) {
    const Eigen::Vector3d p = centre + edge * Eigen::Vector3d(k % 5 - 2, k / 5 % 5 - 2, k / 25 - 2);
    if (query_point(map, p).state == Occupancy::occupied) around.push_back(p);
  }
  return plane_of_points(around, [](const Eigen::Vector3d& p) { return p; }).normal;
}
}  // namespace detail

/// The floor of a map: of the planes that face up and have next to nothing below them, the one on which most
/// occupied voxels lie as parts of a surface along it; by sampling consensus over voxels and the normals
/// there, then total least squares.
/// @return empty: `up` has no direction, or no plane has enough voxels. A table is taken for the floor where
/// none was seen below it: compare `origin_height`
template <VoxelMap M>
[[nodiscard]] std::optional<GroundPlane> fit_ground_plane(const M& map,
                                                          const GroundPlaneOptions& options = {}) {
  using detail::SurfacePoint;
  const double length = options.up.norm(), edge = map.grid().resolution();
  if (!(length > 0) || !std::isfinite(length)) return std::nullopt;
  const Eigen::Vector3d up = options.up / length;
  std::vector<Eigen::Vector3d> all, around;
  const Eigen::Vector3d everywhere = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  query_box(map, -everywhere, everywhere, 0, [&](const auto& cell) { all.push_back(cell.centre); });
  std::vector<SurfacePoint> points;
  const std::size_t step = all.size() / std::max<std::size_t>(1, options.max_points) + 1;
  for (std::size_t i = 0; i < all.size(); i += step)
    points.push_back({all[i], detail::surface_normal(map, all[i], around)});
  if (points.empty()) return std::nullopt;

  const double least_cosine = std::cos(options.max_tilt), same = std::cos(options.max_turn);
  const auto lies_on = [&](const GroundPlane& plane, const SurfacePoint& p) {
    return std::abs(plane.height(p.centre)) <= edge && std::abs(plane.up.dot(p.normal)) >= same;
  };
  GroundPlane best;
  const auto keep = [&](const SurfacePoint& of) {  // whether it is a floor, and better than the best so far
    const Eigen::Vector3d normal = of.normal.dot(up) < 0 ? Eigen::Vector3d(-of.normal) : of.normal;
    if (!(normal.dot(up) >= least_cosine)) return false;
    GroundPlane plane{normal, -normal.dot(of.centre), 0};
    std::size_t on = 0, below = 0;
    for (const SurfacePoint& p : points) {
      on += lies_on(plane, p) ? 1U : 0U;
      below += plane.height(p.centre) < -2 * edge ? 1U : 0U;
    }
    const double n = static_cast<double>(points.size());
    plane.share = static_cast<double>(on) / n;
    if (static_cast<double>(below) > options.max_below * n || plane.share <= best.share) return false;
    best = plane;
    return true;
  };
  std::vector<SurfacePoint> on;
  sample_consensus<1, double>(
      options.sampling,
      [&](SplitMix64& random, std::array<std::size_t, 1>& sample) {
        draw_distinct(random, points.size(), sample);
        return true;
      },
      [&](const std::array<std::size_t, 1>& sample, const auto& consider) { consider(points[sample[0]]); },
      [&](const SurfacePoint& point) -> std::optional<double> {
        if (!keep(point)) return std::nullopt;
        do {  // a voxel's normal is rough: that of all on its plane has more on it
          on.clear();
          for (const SurfacePoint& p : points)
            if (lies_on(best, p)) on.push_back(p);
        } while (keep(detail::plane_of_points(on, [](const SurfacePoint& p) { return p.centre; })));
        return best.share;
      });
  if (!(best.share >= options.min_share)) return std::nullopt;
  return best;
}

/// Frame of a planner on the ground: z up from the ground, x the map's z axis (where the first camera looks)
/// as seen from above, y to the left, the origin below the map's (REP 103 and 105 of ROS).
/// @param up             in the map's frame, any length
/// @param origin_height  of the map's origin above the ground [m]
/// @return T_ground_map; empty where `up` has no direction or a number is not finite
[[nodiscard]] inline std::optional<SE3<double>> ground_frame(const Eigen::Vector3d& up,
                                                             double origin_height) {
  const double length = up.norm();
  if (!(length > 0) || !std::isfinite(length) || !std::isfinite(origin_height)) return std::nullopt;
  const Eigen::Vector3d z = up / length;
  // A camera that looks straight up or down has the top of its image ahead.
  const Eigen::Vector3d ahead = std::abs(z.z()) < 0.99 ? Eigen::Vector3d(Eigen::Vector3d::UnitZ())
                                                       : Eigen::Vector3d(-Eigen::Vector3d::UnitY());
  const Eigen::Vector3d x = (ahead - z.dot(ahead) * z).normalized();
  Eigen::Matrix3d R_ground_map;
  R_ground_map << x.transpose(), z.cross(x).transpose(), z.transpose();
  return SE3<double>(Eigen::Quaterniond(R_ground_map), Eigen::Vector3d(0, 0, origin_height));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
