// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace dynslam::detail {

/// Of a polynomial, the constant first.
template <std::size_t N>
[[nodiscard]] double value_of(const std::array<double, N>& polynomial, double z) {
  double value = 0;
  for (std::size_t i = N; i-- > 0;) value = value * z + polynomial[i];
  return value;
}

/// The root between two numbers at which a polynomial, the first `size` coefficients, has different signs: by
/// Newton's steps, by halves where these leave the interval or hardly narrow it.
inline double root_between(const double* polynomial, std::size_t size, double low, double high,
                           double value_low) {
  double z = 0.5 * (low + high), last = high - low;
  for (int i = 0; i < 60; ++i) {
    double value = 0, slope = 0;
    for (std::size_t k = size; k-- > 0;) {
      slope = slope * z + value;
      value = value * z + polynomial[k];
    }
    if (value == 0) return z;
    if ((value < 0) == (value_low < 0)) {
      low = z;
    } else {
      high = z;
    }
    double next = z - value / slope;
    if (!(next > low && next < high && std::abs(next - z) < 0.5 * last)) next = 0.5 * (low + high);
    last = std::abs(next - z);
    z = next;
    if (last <= 4 * std::numeric_limits<double>::epsilon()) break;
  }
  return z;
}

/// Roots from -1 to 1, in order: between two neighbouring roots of the derivative there is one at most.
template <std::size_t N>
[[nodiscard]] std::size_t roots_within_one(const std::array<double, N>& polynomial,
                                           std::array<double, N - 1>& roots) {
  std::array<std::array<double, N>, N> derivative;  // [i] is of degree i
  derivative[N - 1] = polynomial;
  for (std::size_t i = N - 1; i-- > 0;) {
    for (std::size_t k = 0; k <= i; ++k)
      derivative[i][k] = derivative[i + 1][k + 1] * static_cast<double>(k + 1);
  }
  std::size_t n = 0;
  for (std::size_t degree = 1; degree < N; ++degree) {
    const double* p = derivative[degree].data();
    const auto value = [&](double z) {
      double sum = 0;
      for (std::size_t k = degree + 1; k-- > 0;) sum = sum * z + p[k];
      return sum;
    };
    // A double root that rounding lifted off zero: within sqrt(2 value / curvature) of it.
    const auto touches = [&](double z, double at) {
      constexpr double kNear = 1e-4;
      double curvature = 0;
      for (std::size_t k = degree + 1; k-- > 2;)
        curvature = curvature * z + static_cast<double>(k * (k - 1)) * p[k];
      return 2 * std::abs(at) <= kNear * kNear * std::abs(curvature);
    };
    std::array<double, N - 1> next;
    std::size_t found = 0;
    double low = -1, value_low = value(-1);
    for (std::size_t i = 0; i <= n; ++i) {
      const double high = i < n ? roots[i] : 1.0, value_high = value(high);
      if ((value_low < 0) != (value_high < 0)) {
        next[found++] = root_between(p, degree + 1, low, high, value_low);
      } else if (i < n && degree + 1 == N && touches(high, value_high)) {
        next[found++] = high;
      }
      low = high;
      value_low = value_high;
    }
    n = found;
    std::copy_n(next.begin(), n, roots.begin());
  }
  return n;
}

/// Real roots of a polynomial, the constant first. Those beyond 1 are found as the
/// inverses of those of the polynomial read backwards. @return how many
template <std::size_t N>
[[nodiscard]] int polynomial_roots(const std::array<double, N>& polynomial,
                                   std::array<double, N - 1>& roots) {
  std::array<double, N - 1> beyond;
  std::array<double, N> reversed = polynomial;
  std::reverse(reversed.begin(), reversed.end());
  std::size_t n = roots_within_one(polynomial, roots);
  const std::size_t more = roots_within_one(reversed, beyond);
  for (std::size_t i = 0; i < more && n < N - 1; ++i) {
    if (std::abs(beyond[i]) < 1 && beyond[i] != 0) roots[n++] = 1 / beyond[i];
  }
  return static_cast<int>(n);
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
