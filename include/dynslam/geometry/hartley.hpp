// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>

namespace dynslam {

namespace detail {
/// Similarity that moves points to their centroid and their mean distance to sqrt(2) (Hartley 1997).
/// @param point  point(i) of n
/// @param used   used(i): whether it is one of them
/// @return how many are used; 0 where they coincide
template <std::floating_point S, class Point, class Used>
[[nodiscard]] std::size_t normalising_transform(std::size_t n, const Point& point, const Used& used,
                                                Eigen::Matrix<S, 3, 3>& T) {
  S mean_x = S(0), mean_y = S(0);
  std::size_t count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!used(i)) continue;
    const Eigen::Matrix<S, 2, 1> p = point(i);
    mean_x += p[0];
    mean_y += p[1];
    ++count;
  }
  if (count == 0) return 0;
  mean_x /= static_cast<S>(count);
  mean_y /= static_cast<S>(count);
  S distance = S(0);
  for (std::size_t i = 0; i < n; ++i) {
    if (!used(i)) continue;
    const Eigen::Matrix<S, 2, 1> p = point(i);
    const S dx = p[0] - mean_x, dy = p[1] - mean_y;
    distance += std::sqrt(dx * dx + dy * dy);
  }
  distance /= static_cast<S>(count);
  if (!(distance > S(0)) || !std::isfinite(distance)) return 0;
  const S s = std::sqrt(S(2)) / distance;
  T.setIdentity();
  T(0, 0) = T(1, 1) = s;
  T(0, 2) = -s * mean_x;
  T(1, 2) = -s * mean_y;
  return count;
}

/// T x of such a similarity, homogeneous.
template <std::floating_point S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> normalised(const Eigen::Matrix<S, 3, 3>& T,
                                                const Eigen::Matrix<S, 2, 1>& x) {
  return {T(0, 0) * x[0] + T(0, 2), T(1, 1) * x[1] + T(1, 2), S(1)};
}

/// Adds a a^T, of which the lower triangle.
template <std::floating_point S>
void add_square(const S (&a)[9], Eigen::Matrix<S, 9, 9>& sum) {
  for (int j = 0; j < 9; ++j) {
    for (int i = j; i < 9; ++i) sum(i, j) += a[i] * a[j];
  }
}
}  // namespace detail

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
