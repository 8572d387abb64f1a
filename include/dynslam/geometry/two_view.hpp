// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"

namespace dynslam {

/// What relates two views of a static scene, as far as their matches tell.
enum class TwoViewModel : std::uint8_t {
  none,        ///< nothing: too few matches, or no model that enough of them share
  homography,  ///< a plane, a rotation, or so little parallax that it makes no difference
  fundamental  ///< the depth of the scene shows: epipolar lines
};

/// Options of two_view_geometry().
template <std::floating_point S>
struct TwoViewOptions {
  RansacOptions<S> ransac;  ///< of both models; thresholds in ideal pixels
  /// Off H by more than this, a match is off the plane [px]: parallax that the noise of matches (a few
  /// tenths of a pixel) and the error of H, which is estimated from them, do not explain.
  S min_parallax_px = S(3);
  /// F is believed when this share of its inliers is off the plane. A plane and any two matches beside it
  /// fit some F (Chum et al. 2005), and of wrong matches another 1 or 2 % lie by chance within a pixel of
  /// their lines: that must not suffice.
  S min_off_plane = S(0.1);
};

/// The model that explains two views, and what each match is off it.
template <std::floating_point S>
struct TwoViewResult {
  TwoViewModel model = TwoViewModel::none;
  Eigen::Matrix<S, 3, 3> matrix = Eigen::Matrix<S, 3, 3>::Zero();  ///< H or F, of ideal pixels
  /// Of each match [ideal px]: to its epipolar line or to H x. NaN where the lens has no ray, and for `none`.
  std::vector<S> distance_px;
  int inliers = 0;     ///< of the model
  S off_plane = S(0);  ///< share of F's inliers that the plane does not explain
  [[nodiscard]] bool ok() const { return model != TwoViewModel::none; }
};

/// Memory of two_view_geometry.
template <std::floating_point S>
struct TwoViewWorkspace {
  std::vector<Eigen::Matrix<S, 2, 1>> x, x_m;  // ideal pixels of the matches that have them
  std::vector<std::size_t> match;
  RansacWorkspace ransac;
};

/// Decides between F and H for two views and gives each match's distance to the model, which is what tells
/// moving points from static ones (Eq 8).
///
/// Of a planar scene, and of one seen with hardly any baseline, F is not determined: estimated all the same
/// it follows noise and puts lines anywhere, also away from static points. H then says all that can be
/// said, and more: where a point is, not only on which line. Both are estimated by RANSAC, and F is taken
/// where at least `min_off_plane` of its inliers contradict H. Scores of the whole set (GRIC, Torr 1998, or
/// ORB-SLAM's ratio) weigh outliers, too, to which F, having one constraint less, is always kinder: at 40 %
/// outliers GRIC takes F for planes. Among inliers alone GRIC's preference turns at a fifth off the plane;
/// a tenth is taken here, as F, if wrong, only misses movers, while H, if wrong, accuses static points.
/// @param x, x_m  recorded pixels of the matches in the reference and the current image
template <CameraModel C>
  requires std::floating_point<typename C::ScalarType>
[[nodiscard]] TwoViewResult<typename C::ScalarType> two_view_geometry(
    const C& camera, std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x,
    std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x_m,
    const TwoViewOptions<typename C::ScalarType>& options,
    TwoViewWorkspace<typename C::ScalarType>& workspace) {
  using S = typename C::ScalarType;
  using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
  TwoViewResult<S> result;
  const std::size_t n = std::min(x.size(), x_m.size());
  result.distance_px.assign(n, std::numeric_limits<S>::quiet_NaN());
  const Pinhole<S> pinhole = ideal_pinhole(camera);
  workspace.x.clear();
  workspace.x_m.clear();
  workspace.match.clear();
  for (std::size_t i = 0; i < n; ++i) {
    const auto a = to_ideal(camera, pinhole, x[i]), b = to_ideal(camera, pinhole, x_m[i]);
    if (!a || !b) continue;
    workspace.x.push_back(*a);
    workspace.x_m.push_back(*b);
    workspace.match.push_back(i);
  }
  const Points p(workspace.x), q(workspace.x_m);
  const auto H = homography_ransac<S>(p, q, options.ransac, workspace.ransac);
  const auto F = fundamental_ransac<S>(p, q, options.ransac, workspace.ransac);
  const S far = options.min_parallax_px * options.min_parallax_px;
  int off = 0;
  if (F.status == FundamentalStatus::ok) {
    for (std::size_t k = 0; k < p.size(); ++k) {
      const bool explained = H.model && transfer_distance_squared<S>(*H.model, p[k], q[k]) <= far;
      off += F.inlier[k] != 0 && !explained ? 1 : 0;
    }
    result.off_plane = static_cast<S>(off) / static_cast<S>(F.inliers);
  }
  if (F.status == FundamentalStatus::ok && result.off_plane >= options.min_off_plane) {
    result.model = TwoViewModel::fundamental;
    result.matrix = F.F;
    result.inliers = F.inliers;
  } else if (H.model) {
    result.model = TwoViewModel::homography;
    result.matrix = *H.model;
    result.inliers = H.inliers;
  }
  for (std::size_t k = 0; k < p.size() && result.ok(); ++k) {
    result.distance_px[workspace.match[k]] =
        result.model == TwoViewModel::fundamental
            ? line_distance<S>(result.matrix, p[k], q[k])
            : std::sqrt(transfer_distance_squared<S>(result.matrix, p[k], q[k]));
  }
  return result;
}

/// The same with default options and its own memory.
template <CameraModel C>
  requires std::floating_point<typename C::ScalarType>
[[nodiscard]] TwoViewResult<typename C::ScalarType> two_view_geometry(
    const C& camera, std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x,
    std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x_m) {
  TwoViewWorkspace<typename C::ScalarType> workspace;
  return two_view_geometry(camera, x, x_m, TwoViewOptions<typename C::ScalarType>(), workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
