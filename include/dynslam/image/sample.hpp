// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

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
struct ImageSample {
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

/// The four pixels around a place, and where in between it is.
template <Scalar S>
struct BilinearCell {
  S i00, i10, i01, i11, a, b;
  /// @return false outside of the image, and for NaN
  template <ImageLike I>
  [[nodiscard]] bool find(const I& image, const S& u, const S& v) {
    // Which cell it is does not depend on a derivative.
    using Place = std::conditional_t<std::floating_point<S>, S, double>;
    const Place x = without_derivative(u), y = without_derivative(v);
    const int w = image.width(), h = image.height();
    if (!(x >= 0 && y >= 0 && x <= static_cast<Place>(w - 1) && y <= static_cast<Place>(h - 1)) || w < 2 ||
        h < 2)
      return false;
    const int u0 = std::min(static_cast<int>(x), w - 2), v0 = std::min(static_cast<int>(y), h - 2);
    a = u - as_scalar<S>(u0);
    b = v - as_scalar<S>(v0);
    i00 = as_scalar<S>(image(u0, v0));
    i10 = as_scalar<S>(image(u0 + 1, v0));
    i01 = as_scalar<S>(image(u0, v0 + 1));
    i11 = as_scalar<S>(image(u0 + 1, v0 + 1));
    return true;
  }
  [[nodiscard]] S top() const { return (S(1.0) - a) * i00 + a * i10; }
  [[nodiscard]] S bottom() const { return (S(1.0) - a) * i01 + a * i11; }
  [[nodiscard]] S value() const { return (S(1.0) - b) * top() + b * bottom(); }
};
}  // namespace detail

/// Bilinear value and gradient at (u, v); exact at pixel centres. The gradient is that of the
/// interpolant of the cell to the right and below (to the left and above on the last column and row).
/// nullopt outside [0, width-1] x [0, height-1] and for NaN coordinates.
template <Scalar S, ImageLike I>
[[nodiscard]] std::optional<ImageSample<S>> bilinear_with_gradient(const I& image, const S& u, const S& v) {
  detail::BilinearCell<S> c;
  if (!c.find(image, u, v)) return std::nullopt;
  ImageSample<S> sample;
  sample.value = c.value();
  sample.gradient = Eigen::Matrix<S, 2, 1>(S((S(1.0) - c.b) * (c.i10 - c.i00) + c.b * (c.i11 - c.i01)),
                                           S(c.bottom() - c.top()));
  return sample;
}

/// Bilinear value at (u, v); see bilinear_with_gradient.
template <Scalar S, ImageLike I>
[[nodiscard]] std::optional<S> bilinear(const I& image, const S& u, const S& v) {
  detail::BilinearCell<S> c;
  if (!c.find(image, u, v)) return std::nullopt;
  return c.value();
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
