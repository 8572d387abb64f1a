// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>

namespace dynslam {

namespace detail {
/// Similarity that moves points to their centroid and their mean distance to sqrt(2) (Hartley 1997).
template <std::floating_point S, class Point>
[[nodiscard]] bool normalising_transform(std::size_t n, const Point& point, Eigen::Matrix<S, 3, 3>& T) {
  Eigen::Matrix<S, 2, 1> mean = Eigen::Matrix<S, 2, 1>::Zero();
  for (std::size_t i = 0; i < n; ++i) mean += point(i);
  mean /= static_cast<S>(n);
  S distance = S(0);
  for (std::size_t i = 0; i < n; ++i) distance += (point(i) - mean).norm();
  distance /= static_cast<S>(n);
  if (!(distance > S(0)) || !std::isfinite(distance)) return false;
  const S s = std::sqrt(S(2)) / distance;
  T << s, S(0), -s * mean.x(), S(0), s, -s * mean.y(), S(0), S(0), S(1);
  return true;
}
}  // namespace detail

}  // namespace dynslam
