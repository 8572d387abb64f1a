// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

/// Non-owning view of pixels that lie at any regular distances: column-major matrices, every second pixel,
/// one channel of several. Pixel (u, v) is `data[u * step_u + v * step_v]`, steps in elements; they may be
/// negative. Shallow const as ImageView, which is the better choice where a row is contiguous. The memory
/// must outlive the view. Out-of-range access is a programmer error (asserted in debug builds).
template <class T>
class StridedView {
 public:
  using Pixel = std::remove_const_t<T>;

  constexpr StridedView() = default;
  constexpr StridedView(T* data, int width, int height, std::ptrdiff_t step_u, std::ptrdiff_t step_v)
      : data_(data), width_(width), height_(height), step_u_(step_u), step_v_(step_v) {
    DYNSLAM_ASSERT(width >= 0 && height >= 0, "a view needs non-negative sizes");
  }
  /// StridedView<T> to StridedView<const T>.
  template <class U>
    requires(std::is_const_v<T>&& std::is_same_v<U, Pixel>)
  constexpr StridedView(
      const StridedView<U>& other)  // NOLINT(google-explicit-constructor): a view that promises less
      : StridedView(other.data(), other.width(), other.height(), other.step_u(), other.step_v()) {}

  [[nodiscard]] constexpr int width() const { return width_; }
  [[nodiscard]] constexpr int height() const { return height_; }
  [[nodiscard]] constexpr std::ptrdiff_t step_u() const { return step_u_; }
  [[nodiscard]] constexpr std::ptrdiff_t step_v() const { return step_v_; }
  [[nodiscard]] constexpr T* data() const { return data_; }
  [[nodiscard]] constexpr bool contains(int u, int v) const {
    return u >= 0 && v >= 0 && u < width_ && v < height_;
  }
  [[nodiscard]] constexpr T& operator()(int u, int v) const {
    DYNSLAM_ASSERT(contains(u, v), "pixel outside the image");
    return data_[u * step_u_ + v * step_v_];
  }

 private:
  T* data_ = nullptr;
  int width_ = 0, height_ = 0;
  std::ptrdiff_t step_u_ = 0, step_v_ = 0;
};

static_assert(DepthImage<StridedView<float>> && DepthImage<StridedView<const double>>);
static_assert(LabelImage<StridedView<const unsigned char>> && MutableImage<StridedView<float>>);
static_assert(!MutableImage<StridedView<const float>> && !RowImage<StridedView<float>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
