// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_view.hpp"

namespace dynslam {

/// Copies of an image, from its own size (level 0) to smaller ones. Pixel centres are at integers on every
/// level; `scale(level)` is the width and height of a level's pixel in pixels of level 0.
template <class P>
concept ImagePyramidLike = requires(const P& pyramid, int level) {
  { pyramid.size() } -> std::convertible_to<int>;  // how many levels
  requires RowImage<std::remove_cvref_t<decltype(pyramid.image(level))>>;
  { pyramid.scale(level) } -> std::convertible_to<Eigen::Vector2d>;
};

/// Coordinates on `level` of the pixel `x` of level 0, and back.
template <std::floating_point S, ImagePyramidLike P>
[[nodiscard]] Eigen::Matrix<S, 2, 1> to_level(const P& pyramid, const Eigen::Matrix<S, 2, 1>& x, int level) {
  const Eigen::Vector2d scale = pyramid.scale(level);
  constexpr S kHalf = S(0.5);
  return Eigen::Matrix<S, 2, 1>((x.x() + kHalf) / static_cast<S>(scale.x()) - kHalf,
                                (x.y() + kHalf) / static_cast<S>(scale.y()) - kHalf);
}
/// The way back: pixel of the base from a pixel of `level`.
template <std::floating_point S, ImagePyramidLike P>
[[nodiscard]] Eigen::Matrix<S, 2, 1> to_base(const P& pyramid, const Eigen::Matrix<S, 2, 1>& x, int level) {
  const Eigen::Vector2d scale = pyramid.scale(level);
  constexpr S kHalf = S(0.5);
  return Eigen::Matrix<S, 2, 1>((x.x() + kHalf) * static_cast<S>(scale.x()) - kHalf,
                                (x.y() + kHalf) * static_cast<S>(scale.y()) - kHalf);
}

/// A pyramid of half sizes: each pixel is the mean of 2 x 2 of the level below it; an odd last row or column
/// is dropped. Level 0 is a copy, so the pyramid outlives the image. Memory is reused.
template <class T = std::uint8_t>
class HalvingPyramid {
 public:
  /// @param levels  wanted, 1 or more; a level of less than 16 pixels in either direction is not made
  /// @param pixel_size  of the image, where it is itself a level of another pyramid [px of that one's level
  /// 0]
  template <ImageLike I>
    requires std::constructible_from<T, typename I::Pixel>
  void build(const I& image, int levels, const Eigen::Vector2d& pixel_size = Eigen::Vector2d::Ones()) {
    DYNSLAM_ASSERT(levels >= 1, "level 0 is the image");
    pixel_size_ = pixel_size;
    images_.resize(std::max(images_.size(), static_cast<std::size_t>(levels)));
    Image<T>& base = images_.front();
    base.resize(image.width(), image.height());
    for (int v = 0; v < image.height(); ++v) {
      T* out = base.row(v);
      if constexpr (RowImage<I>) {
        const auto* row = image.row(v);
        std::transform(row, row + image.width(), out, [](const auto& p) { return static_cast<T>(p); });
      } else {
        for (int u = 0; u < image.width(); ++u) out[u] = static_cast<T>(image(u, v));
      }
    }
    for (levels_ = 1; levels_ < levels; ++levels_) {
      const Image<T>& from = images_[static_cast<std::size_t>(levels_) - 1];
      if (std::min(from.width(), from.height()) < 2 * kSmallest) break;
      halve(from, images_[static_cast<std::size_t>(levels_)]);
    }
  }

  [[nodiscard]] int size() const { return levels_; }
  [[nodiscard]] ImageView<const T> image(int i) const { return images_[static_cast<std::size_t>(i)].view(); }
  [[nodiscard]] Eigen::Vector2d scale(int i) const {
    const auto pixels = static_cast<double>(1 << i);
    return Eigen::Vector2d(pixel_size_.x() * pixels, pixel_size_.y() * pixels);
  }

 private:
  static constexpr int kSmallest = 16;  // pixels: room for a patch and its search

  static void halve(const Image<T>& from, Image<T>& to) {
    const int w = from.width() / 2, h = from.height() / 2;
    to.resize(w, h);
    for (int v = 0; v < h; ++v) {
      const T *a = from.row(2 * v), *b = from.row(2 * v + 1);
      T* out = to.row(v);
      for (int u = 0; u < w; ++u) {
        if constexpr (std::is_same_v<T, std::uint8_t>) {
          // Two bytes at a time: neighbours of one load are told apart faster than loads of every second
          // byte.
          std::uint16_t above, below;
          std::memcpy(&above, a + 2 * u, 2);
          std::memcpy(&below, b + 2 * u, 2);
          out[u] =
              static_cast<T>(((above & 0xffU) + (above >> 8U) + (below & 0xffU) + (below >> 8U) + 2U) >> 2U);
        } else if constexpr (std::integral<T>) {
          out[u] = static_cast<T>((a[2 * u] + a[2 * u + 1] + b[2 * u] + b[2 * u + 1] + 2) / 4);
        } else {
          out[u] = T(0.25) * (a[2 * u] + a[2 * u + 1] + b[2 * u] + b[2 * u + 1]);
        }
      }
    }
  }

  std::vector<Image<T>> images_;
  Eigen::Vector2d pixel_size_ = Eigen::Vector2d::Ones();
  int levels_ = 0;
};

static_assert(ImagePyramidLike<HalvingPyramid<std::uint8_t>> && ImagePyramidLike<HalvingPyramid<float>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
