// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "dynslam/image/image_view.hpp"

namespace dynslam {

/// Owning image without row padding. `resize` never gives memory back, so a reused image stops
/// allocating after its largest use.
template <class T>
class Image {
 public:
  using Pixel = T;

  Image() = default;
  /// Numbers are 0; of a type that leaves its values unset, as Eigen's, they are.
  Image(int width, int height) : width_(width), height_(height), pixels_(count(width, height)) {}
  Image(int width, int height, const T& fill)
      : width_(width), height_(height), pixels_(count(width, height), fill) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool contains(int u, int v) const { return u >= 0 && v >= 0 && u < width_ && v < height_; }
  [[nodiscard]] T* data() { return pixels_.data(); }
  [[nodiscard]] const T* data() const { return pixels_.data(); }
  [[nodiscard]] T* row(int v) { return view().row(v); }
  [[nodiscard]] const T* row(int v) const { return view().row(v); }
  [[nodiscard]] T& operator()(int u, int v) { return view()(u, v); }
  [[nodiscard]] const T& operator()(int u, int v) const { return view()(u, v); }
  /// Valid as long as the image has its memory: a temporary gives none.
  [[nodiscard]] ImageView<T> view() & { return {pixels_.data(), width_, height_}; }
  [[nodiscard]] ImageView<const T> view() const& { return {pixels_.data(), width_, height_}; }
  ImageView<const T> view() const&& = delete;

  void fill(const T& value) { std::fill(pixels_.begin(), pixels_.end(), value); }
  /// Contents are unspecified afterwards where the size changed.
  void resize(int width, int height) {
    width_ = width;
    height_ = height;
    pixels_.resize(count(width, height));
  }

 private:
  static std::size_t count(int width, int height) {
    DYNSLAM_ASSERT(width >= 0 && height >= 0, "an image needs non-negative sizes");
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  int width_ = 0, height_ = 0;
  std::vector<T> pixels_;
};

static_assert(DepthImage<Image<float>> && DepthImage<Image<double>> && LabelImage<Image<unsigned char>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
