// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

/// Non-owning view of pixels in row-major order with a row stride in elements; (u, v) addressing.
/// Shallow const: an ImageView<T> gives writable pixels, an ImageView<const T> does not.
/// The memory must outlive the view. Out-of-range access is a programmer error (asserted in debug builds).
template <class T>
class ImageView {
 public:
  using Pixel = std::remove_const_t<T>;

  constexpr ImageView() = default;
  constexpr ImageView(T* data, int width, int height, std::ptrdiff_t stride)
      : data_(data), width_(width), height_(height), stride_(stride) {
    DYNSLAM_ASSERT(width >= 0 && height >= 0 && stride >= width,
                   "a view needs non-negative sizes and stride >= width");
  }
  constexpr ImageView(T* data, int width, int height) : ImageView(data, width, height, width) {}
  /// ImageView<T> to ImageView<const T>.
  template <class U>
    requires(std::is_const_v<T>&& std::is_same_v<U, Pixel>)
  constexpr ImageView(
      const ImageView<U>& other)  // NOLINT(google-explicit-constructor): a view that promises less
      : ImageView(other.data(), other.width(), other.height(), other.stride()) {}

  [[nodiscard]] constexpr int width() const { return width_; }
  [[nodiscard]] constexpr int height() const { return height_; }
  [[nodiscard]] constexpr std::ptrdiff_t stride() const { return stride_; }
  [[nodiscard]] constexpr T* data() const { return data_; }
  [[nodiscard]] constexpr bool contains(int u, int v) const {
    return u >= 0 && v >= 0 && u < width_ && v < height_;
  }
  [[nodiscard]] constexpr T* row(int v) const {
    DYNSLAM_ASSERT(v >= 0 && v < height_, "row outside the image");
    return data_ + v * stride_;
  }
  [[nodiscard]] constexpr T& operator()(int u, int v) const {
    DYNSLAM_ASSERT(contains(u, v), "pixel outside the image");
    return data_[v * stride_ + u];
  }

 private:
  T* data_ = nullptr;
  int width_ = 0, height_ = 0;
  std::ptrdiff_t stride_ = 0;
};

static_assert(DepthImage<ImageView<float>> && DepthImage<ImageView<const double>>);
static_assert(LabelImage<ImageView<const unsigned char>> && MutableImage<ImageView<float>>);
static_assert(!MutableImage<ImageView<const float>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
