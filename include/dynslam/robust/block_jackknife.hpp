// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>

namespace dynslam {

namespace detail {

/// 97.5 % quantile of Student's t-distribution: the expansion about the normal one's (Abramowitz and Stegun
/// 26.7.5), good to 1 % from 4 degrees of freedom on.
[[nodiscard]] inline double t_quantile_975(double freedom) {
  constexpr double z = 1.959964, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
  return z + (z3 + z) / (4 * freedom) + (5 * z5 + 16 * z3 + 3 * z) / (96 * freedom * freedom) +
         (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * freedom * freedom * freedom);
}

}  // namespace detail

/// Half of the 95 % interval of an estimate from a series whose errors are correlated over an unknown time:
/// the jackknife over segments of the series (Kuensch 1989), t sqrt((n - 1) / n sum (e_k - mean e)^2), with
/// e_k the estimate without segment k and Student's t of n - 1 degrees of freedom. Segments of the series
/// divided by 6, 12 and 24; the widest of the three intervals is taken, for segments shorter than what
/// correlates make it too narrow.
/// @param length   of the series
/// @param without  (first, end) -> the estimate when what has positions from `first` to before `end` is left
///                 out; not finite where that leaves too little
/// @return  infinite where a segment cannot be spared, or the series is shorter than six
template <std::floating_point S, class F>
  requires std::invocable<F&, std::size_t, std::size_t>
[[nodiscard]] S block_jackknife(std::size_t length, F&& without) {
  constexpr std::array<std::size_t, 3> kSegments{6, 12, 24};
  S widest = S(0);
  for (const std::size_t n : kSegments) {
    if (length < n) break;
    std::array<double, kSegments.back()> estimate{};
    double mean = 0;
    for (std::size_t k = 0; k < n; ++k) {
      estimate[k] = static_cast<double>(without(k * length / n, (k + 1) * length / n));
      mean += estimate[k] / static_cast<double>(n);
    }
    double sum = 0;
    for (std::size_t k = 0; k < n; ++k) sum += (estimate[k] - mean) * (estimate[k] - mean);
    const double share = static_cast<double>(n - 1) / static_cast<double>(n);
    const double half = detail::t_quantile_975(static_cast<double>(n - 1)) * std::sqrt(share * sum);
    if (!std::isfinite(half)) return std::numeric_limits<S>::infinity();
    widest = std::max(widest, static_cast<S>(half));
  }
  return length < kSegments.front() ? std::numeric_limits<S>::infinity() : widest;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
