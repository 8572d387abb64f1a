// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

// Where the curve of a lens turns back. In double whatever the scalar: a limit is not differentiated.
namespace dynslam::detail {

/// Value at t of c[0] + c[1] t + c[2] t^2 + ...
template <std::size_t N>
[[nodiscard]] constexpr double polynomial(const std::array<double, N>& c, double t) {
  double value = 0.0;
  for (std::size_t k = N; k-- > 0;) value = value * t + c[k];
  return value;
}

/// Places in (0, limit) where a polynomial changes its sign, ascending: between two such places of its
/// derivative it is monotone, so bisection finds all.
template <std::size_t N>
struct SignChanges {
  std::array<double, N> at{};
  std::size_t count = 0;

  SignChanges(const std::array<double, N>& c, double limit) {
    if constexpr (N > 1) {
      std::array<double, N - 1> slope{};
      for (std::size_t k = 1; k < N; ++k) slope[k - 1] = static_cast<double>(k) * c[k];
      const SignChanges<N - 1> turns(slope, limit);
      double low = 0.0;
      for (std::size_t k = 0; k <= turns.count; ++k) {
        const double high = k < turns.count ? turns.at[k] : limit;
        bisect(c, low, high);
        low = high;
      }
    }
  }

 private:
  void bisect(const std::array<double, N>& c, double low, double high) {
    const bool rises = polynomial(c, low) < 0.0;
    if (rises == (polynomial(c, high) < 0.0)) return;
    for (;;) {
      const double middle = 0.5 * (low + high);
      if (!(low < middle && middle < high)) break;
      ((polynomial(c, middle) < 0.0) == rises ? low : high) = middle;
    }
    at[count++] = low;
  }
};

/// Smallest t in (0, limit) at which a polynomial that is positive at 0 becomes negative; infinite where
/// it stays positive.
template <std::size_t N>
[[nodiscard]] double first_root(const std::array<double, N>& c, double limit) {
  const SignChanges<N> changes(c, limit);
  return changes.count > 0 ? changes.at[0] : std::numeric_limits<double>::infinity();
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
