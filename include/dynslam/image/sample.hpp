// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// Interpolated value and its derivative with respect to (u, v) [per pixel].
template <Scalar S>
struct Sample {
  S value;
  Eigen::Matrix<S, 2, 1> gradient;
};

/// Bilinear value and gradient at (u, v); exact at pixel centres. The gradient is that of the
/// interpolant of the cell to the right and below (to the left and above on the last column and row).
/// nullopt outside [0, width-1] x [0, height-1] and for NaN coordinates.
template <std::floating_point S, ImageLike I>
[[nodiscard]] std::optional<Sample<S>> bilinear_with_gradient(const I& image, S u, S v) {
  const int w = image.width(), h = image.height();
  if (!(u >= S(0) && v >= S(0) && u <= S(w - 1) && v <= S(h - 1)) || w < 2 || h < 2) return std::nullopt;
  const int u0 = u >= S(w - 1) ? w - 2 : static_cast<int>(u);
  const int v0 = v >= S(h - 1) ? h - 2 : static_cast<int>(v);
  const S a = u - S(u0), b = v - S(v0);
  const S i00 = static_cast<S>(image(u0, v0)), i10 = static_cast<S>(image(u0 + 1, v0));
  const S i01 = static_cast<S>(image(u0, v0 + 1)), i11 = static_cast<S>(image(u0 + 1, v0 + 1));
  const S top = (S(1) - a) * i00 + a * i10, bottom = (S(1) - a) * i01 + a * i11;
  Sample<S> sample;
  sample.value = (S(1) - b) * top + b * bottom;
  sample.gradient = {(S(1) - b) * (i10 - i00) + b * (i11 - i01), bottom - top};
  return sample;
}

/// Bilinear value at (u, v); see bilinear_with_gradient.
template <std::floating_point S, ImageLike I>
[[nodiscard]] std::optional<S> bilinear(const I& image, S u, S v) {
  const auto sample = bilinear_with_gradient(image, u, v);
  if (!sample) return std::nullopt;
  return sample->value;
}

}  // namespace dynslam
