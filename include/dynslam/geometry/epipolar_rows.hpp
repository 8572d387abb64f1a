// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>

#include "dynslam/config.hpp"

namespace dynslam {

/// Matches of two images as rows of numbers of one size [px].
template <std::floating_point S>
struct PixelRows {
  std::span<const S> x, y;      ///< in the reference image
  std::span<const S> x_m, y_m;  ///< in the present image
};

namespace detail {
/// Calls finish(numerator, squared denominator, out) with arrays of 64 numbers, or of one for what is left,
/// which parts(x, y, x_m, y_m, numerator, denominator) gave one by one.
template <std::floating_point S, class Parts, class Finish>
void for_pixel_rows(const PixelRows<S>& rows, std::span<S> out, const Parts& parts, const Finish& finish) {
  const std::size_t n = out.size();
  DYNSLAM_ASSERT(rows.x.size() == n && rows.y.size() == n && rows.x_m.size() == n && rows.y_m.size() == n,
                 "rows of one size");
  constexpr int kBlock = 64;
  const auto block = [&]<int N>(std::size_t k, std::integral_constant<int, N>) {
    Eigen::Array<S, N, 1> above, below;
    const S *x = rows.x.data() + k, *y = rows.y.data() + k, *x_m = rows.x_m.data() + k,
            *y_m = rows.y_m.data() + k;
    S *a = above.data(), *b = below.data();
    for (int i = 0; i < N; ++i) parts(x[i], y[i], x_m[i], y_m[i], a[i], b[i]);
    finish(above, below, Eigen::Map<Eigen::Array<S, N, 1>>(out.data() + k));
  };
  std::size_t k = 0;
  for (; k + kBlock <= n; k += kBlock) block(k, std::integral_constant<int, kBlock>());
  for (; k < n; ++k) block(k, std::integral_constant<int, 1>());
}
}  // namespace detail

/// line_distance() of many matches: |x_m^T F x| / |(F x)_xy| [px] (Eq 8). Without a meaning at the epipole,
/// where x has no line.
/// @param out  of the rows' size
template <std::floating_point S>
void line_distances(const Eigen::Matrix<S, 3, 3>& F, const PixelRows<S>& rows, std::span<S> out) {
  const S f00 = F(0, 0), f01 = F(0, 1), f02 = F(0, 2), f10 = F(1, 0), f11 = F(1, 1), f12 = F(1, 2),
          f20 = F(2, 0), f21 = F(2, 1), f22 = F(2, 2);
  detail::for_pixel_rows<S>(
      rows, out,
      [=](S x, S y, S x_m, S y_m, S& e, S& norm2) {
        const S a = f00 * x + f01 * y + f02, b = f10 * x + f11 * y + f12;
        e = a * x_m + b * y_m + (f20 * x + f21 * y + f22);
        norm2 = a * a + b * b;
      },
      [](const auto& e, const auto& norm2, auto to) {
        // Of a line of length 0, e is not its distance: the smallest number keeps the quotient finite.
        to = e.abs() / norm2.max(std::numeric_limits<S>::min()).sqrt();
      });
}

/// sampson_distance_squared() of many matches [px^2]; without a meaning where its gradient vanishes.
template <std::floating_point S>
void sampson_distances_squared(const Eigen::Matrix<S, 3, 3>& F, const PixelRows<S>& rows, std::span<S> out) {
  const S f00 = F(0, 0), f01 = F(0, 1), f02 = F(0, 2), f10 = F(1, 0), f11 = F(1, 1), f12 = F(1, 2),
          f20 = F(2, 0), f21 = F(2, 1), f22 = F(2, 2);
  detail::for_pixel_rows<S>(
      rows, out,
      [=](S x, S y, S x_m, S y_m, S& e2, S& gradient) {
        const S a = f00 * x + f01 * y + f02, b = f10 * x + f11 * y + f12;
        const S c = f00 * x_m + f10 * y_m + f20, d = f01 * x_m + f11 * y_m + f21;
        const S e = a * x_m + b * y_m + (f20 * x + f21 * y + f22);
        e2 = e * e;
        gradient = a * a + b * b + c * c + d * d;
      },
      [](const auto& e2, const auto& gradient, auto to) { to = e2 / gradient; });
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
