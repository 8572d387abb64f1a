// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
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
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/ray_consensus.hpp"

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
  RansacOptions<S> ransac;  ///< of both models; thresholds in recorded pixels
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
  /// Of each match [recorded px]: to its epipolar curve or to H x. NaN for invalid ones, and for `none`.
  std::vector<S> distance_px;
  std::vector<std::uint8_t> invalid;  ///< 1: not finite, or the lens has no ray there; nothing can be said
  int inliers = 0;                    ///< of the model
  S off_plane = S(0);                 ///< share of F's inliers that the plane does not explain
  [[nodiscard]] bool ok() const { return model != TwoViewModel::none; }
};

/// Memory of two_view_geometry.
template <std::floating_point S>
struct TwoViewWorkspace {
  std::vector<PixelRay<double>> x, x_m;  // of the matches that have them
  std::vector<std::size_t> match;
  RansacWorkspace ransac;
};

namespace detail {

/// The model of rays, its matrix being that of rays, too.
struct RayModel {
  TwoViewModel model = TwoViewModel::none;
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  int inliers = 0;
  double off_plane = 0;

  /// Of a match [recorded px].
  [[nodiscard]] double distance(const PixelRay<double>& x, const PixelRay<double>& x_m) const {
    return model == TwoViewModel::fundamental ? epipolar_distance<double>(matrix, x, x_m)
                                              : std::sqrt(transfer_distance_squared<double>(matrix, x, x_m));
  }
};

template <std::same_as<double> W = double>
[[nodiscard]] RayModel model_of_rays(std::span<const PixelRay<double>> x,
                                     std::span<const PixelRay<double>> x_m, const TwoViewOptions<W>& options,
                                     RansacWorkspace& workspace) {
  RayModel result;
  const auto H = homography_ransac(x, x_m, options.ransac, workspace);
  const auto F = fundamental_ransac(x, x_m, options.ransac, workspace);
  const double far = options.min_parallax_px * options.min_parallax_px;
  int off = 0;
  if (F.status == FundamentalStatus::ok) {
    for (std::size_t k = 0; k < F.inlier.size(); ++k) {
      const bool explained = H.model && transfer_distance_squared<double>(*H.model, x[k], x_m[k]) <= far;
      off += F.inlier[k] != 0 && !explained ? 1 : 0;
    }
    result.off_plane = static_cast<double>(off) / static_cast<double>(F.inliers);
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
  return result;
}

}  // namespace detail

/// Decides between F and H for two views and gives each match's distance to the model, which is what tells
/// moving points from static ones (Eq 8). Both are models of rays, so that any lens and any angle will do,
/// and distances are first-order ones in recorded pixels: in those of an ideal pinhole, noise would grow with
/// 1 / cos^2 of the angle from the axis.
///
/// Of a planar scene, and of one seen with hardly any baseline, F is not determined: estimated all the same
/// it follows noise and puts lines anywhere, also away from static points. H then says all that can be
/// said, and more: where a point is, not only on which line. Both are estimated by RANSAC, and F is taken
/// where at least `min_off_plane` of its inliers contradict H. Scores of the whole set (GRIC, Torr 1998, or
/// ORB-SLAM's ratio) weigh outliers, too, to which F, having one constraint less, is always kinder: at 40 %
/// outliers GRIC takes F for planes. Among inliers alone GRIC's preference turns at a fifth off the plane;
/// a tenth is taken here, as F, if wrong, only misses moving objects, while H, if wrong, accuses static
/// points.
/// @param camera  any with a derivative
/// @param x, x_m  recorded pixels of the matches in the reference and the current image
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
[[nodiscard]] TwoViewResult<typename C::ScalarType> two_view_geometry(
    const C& camera, std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x,
    std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x_m,
    const TwoViewOptions<typename C::ScalarType>& options,
    TwoViewWorkspace<typename C::ScalarType>& workspace) {
  using S = typename C::ScalarType;
  TwoViewResult<S> result;
  const std::size_t n = std::min(x.size(), x_m.size());
  result.distance_px.assign(n, std::numeric_limits<S>::quiet_NaN());
  result.invalid.assign(n, 1);
  detail::rays_of_matches(camera, x.first(n), x_m.first(n), workspace.x, workspace.x_m, workspace.match);
  for (const std::size_t i : workspace.match) result.invalid[i] = 0;
  const TwoViewOptions<double> in_double{detail::ransac_in_double(options.ransac),
                                         static_cast<double>(options.min_parallax_px),
                                         static_cast<double>(options.min_off_plane)};
  const auto found = detail::model_of_rays(workspace.x, workspace.x_m, in_double, workspace.ransac);
  result.model = found.model;
  result.inliers = found.inliers;
  result.off_plane = static_cast<S>(found.off_plane);
  if (!result.ok()) return result;
  const Eigen::Matrix3d K = ideal_pinhole(camera).template cast<double>().K(), K_inverse = K.inverse();
  Eigen::Matrix3d matrix = result.model == TwoViewModel::fundamental
                               ? Eigen::Matrix3d(K_inverse.transpose() * found.matrix * K_inverse)
                               : Eigen::Matrix3d(K * found.matrix * K_inverse);
  matrix /= matrix.norm();
  result.matrix = matrix.cast<S>();
  for (std::size_t k = 0; k < workspace.match.size(); ++k)
    result.distance_px[workspace.match[k]] = static_cast<S>(found.distance(workspace.x[k], workspace.x_m[k]));
  return result;
}

/// The same with default options and its own memory.
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
[[nodiscard]] TwoViewResult<typename C::ScalarType> two_view_geometry(
    const C& camera, std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x,
    std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x_m) {
  TwoViewWorkspace<typename C::ScalarType> workspace;
  return two_view_geometry(camera, x, x_m, TwoViewOptions<typename C::ScalarType>(), workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
