// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>

#include "dynslam/geometry/detail/ray_search.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/fundamental_search.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/ray_matches.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam {

/// homography_ransac() of rays, through any lens: ray_m ~ H ray with a positive factor. Thresholds are of
/// recorded pixels, to first order.
template <std::same_as<double> W = double>  // of a template nothing is compiled where it is not used
[[nodiscard]] RansacOutcome<Eigen::Matrix<W, 3, 3>> homography_ransac(
    std::type_identity_t<std::span<const PixelRay<W>>> x,
    std::type_identity_t<std::span<const PixelRay<W>>> x_m, const RansacOptions<W>& options,
    RansacWorkspace& workspace) {
  const std::size_t n = std::min(x.size(), x_m.size());
  RansacOutcome<Eigen::Matrix3d> result;
  result.inlier.assign(n, 0);
  if (n < detail::least_matches(4, options)) return result;
  detail::RayMatches matches;
  matches.set(x, x_m, workspace);
  const double limit = options.threshold_px * options.threshold_px;
  detail::RayHomographySearch<double> search(matches, limit);
  detail::BestModel best(search, options.refinements);
  result.iterations = detail::sample_homographies(matches, options, best);
  best.finish();
  if (best.inliers() == 0) return result;
  const Eigen::Matrix3d T_m_inverse = matches.T_m().inverse();
  result.model = detail::product<double>(detail::product<double>(T_m_inverse, best.model()), matches.T());
  *result.model /= result.model->norm();
  for (std::size_t i = 0; i < n; ++i) {
    result.inlier[i] = transfer_distance_squared<double>(*result.model, x[i], x_m[i]) <= limit ? 1 : 0;
    result.inliers += result.inlier[i];
  }
  if (result.inliers < options.min_inliers) result.model.reset();
  return result;
}

/// fundamental_ransac() of rays, through any lens and at any angle: ray_m^T F ray = 0. Thresholds are of
/// Sampson's distance in recorded pixels. F has rank 2 and is not made an essential matrix.
template <std::same_as<double> W = double>
[[nodiscard]] FundamentalResult<W> fundamental_ransac(std::type_identity_t<std::span<const PixelRay<W>>> x,
                                                      std::type_identity_t<std::span<const PixelRay<W>>> x_m,
                                                      const RansacOptions<W>& options,
                                                      RansacWorkspace& workspace) {
  const std::size_t n = std::min(x.size(), x_m.size());
  FundamentalResult<double> result;
  result.inlier.assign(n, 0);
  if (n < detail::least_matches(8, options)) return result;
  result.status = FundamentalStatus::no_consensus;
  detail::RayMatches matches;
  matches.set(x, x_m, workspace);
  const double limit = options.threshold_px * options.threshold_px;
  detail::RayFundamentalSearch<double> search(matches, limit);
  detail::RayHomographySearch<double> planes(matches, limit);
  detail::BestModel best(search, options.refinements);
  result.iterations = detail::sample_fundamentals(matches, options, search, planes, best, workspace.index);
  if (best.inliers() == 0) return result;
  const Eigen::Matrix3d T_m_T = matches.T_m().transpose();
  result.F = detail::product<double>(detail::product<double>(T_m_T, best.model()), matches.T());
  result.F /= result.F.norm();
  for (std::size_t i = 0; i < n; ++i) {
    result.inlier[i] = sampson_distance_squared<double>(result.F, x[i], x_m[i]) <= limit ? 1 : 0;
    result.inliers += result.inlier[i];
  }
  if (result.inliers >= options.min_inliers) result.status = FundamentalStatus::ok;
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
