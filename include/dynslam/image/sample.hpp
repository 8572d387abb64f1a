// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <optional>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// Interpolated value and its derivative with respect to (u, v) [per pixel].
template <Scalar S>
struct Sample {
  S value;
  Eigen::Matrix<S, 2, 1> gradient;
};

namespace detail {
template <Scalar S>
[[nodiscard]] auto without_derivative(const S& x) {
  if constexpr (std::floating_point<S>) {
    return x;
  } else {
    return to_double(x);
  }
}
/// A number as an S, without a detour over double where S needs none.
template <Scalar S, class T>
[[nodiscard]] S as_scalar(const T& value) {
  if constexpr (std::floating_point<S>) {
    return static_cast<S>(value);
  } else {
    return S(static_cast<double>(value));
  }
}
}  // namespace detail

/// Bilinear value and gradient at (u, v); exact at pixel centres. The gradient is that of the
/// interpolant of the cell to the right and below (to the left and above on the last column and row).
/// nullopt outside [0, width-1] x [0, height-1] and for NaN coordinates.
template <Scalar S, ImageLike I>
[[nodiscard]] std::optional<Sample<S>> bilinear_with_gradient(const I& image, const S& u, const S& v) {
  // Which cell it is does not depend on a derivative.
  using Place = std::conditional_t<std::floating_point<S>, S, double>;
  const Place x = detail::without_derivative(u), y = detail::without_derivative(v);
  const int w = image.width(), h = image.height();
  if (!(x >= 0 && y >= 0 && x <= static_cast<Place>(w - 1) && y <= static_cast<Place>(h - 1)) || w < 2 ||
      h < 2)
    return std::nullopt;
  const int u0 = std::min(static_cast<int>(x), w - 2), v0 = std::min(static_cast<int>(y), h - 2);
  const S one(1.0), a = u - detail::as_scalar<S>(u0), b = v - detail::as_scalar<S>(v0);
  const auto pixel = [&](int i, int j) { return detail::as_scalar<S>(image(i, j)); };
  const S i00 = pixel(u0, v0), i10 = pixel(u0 + 1, v0), i01 = pixel(u0, v0 + 1), i11 = pixel(u0 + 1, v0 + 1);
  const S top = (one - a) * i00 + a * i10, bottom = (one - a) * i01 + a * i11;
  Sample<S> sample;
  sample.value = (one - b) * top + b * bottom;
  sample.gradient = Eigen::Matrix<S, 2, 1>(S((one - b) * (i10 - i00) + b * (i11 - i01)), S(bottom - top));
  return sample;
}

/// Bilinear value at (u, v); see bilinear_with_gradient.
template <Scalar S, ImageLike I>
[[nodiscard]] std::optional<S> bilinear(const I& image, const S& u, const S& v) {
  const auto sample = bilinear_with_gradient(image, u, v);
  if (!sample) return std::nullopt;
  return sample->value;
}

}  // namespace dynslam
