// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <type_traits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

namespace detail {
/// A row of an image without contiguous rows, indexed as a pointer would be.
template <class I>
struct RowOfPixels {
  I* image;
  int v;
  decltype(auto) operator[](int u) const { return (*image)(u, v); }
};

/// An image whose rows are contiguous pixels that can be assigned.
template <class I>
concept MutableRowImage = MutableImage<I> && requires(I& image, int v, typename I::Pixel p) {
  { image.row(v) } -> std::same_as<typename I::Pixel*>;
};
}  // namespace detail

/// Row v of an image, `row[u]` being the pixel (u, v): a pointer where the image has contiguous rows, so that
/// loops run at their speed, and (u, v) access otherwise.
template <class I>
  requires ImageLike<std::remove_const_t<I>>
[[nodiscard]] auto image_row(I& image, int v) {
  if constexpr (detail::MutableRowImage<I> || (RowImage<std::remove_const_t<I>> && !MutableImage<I>)) {
    return image.row(v);
  } else {
    return detail::RowOfPixels<I>{&image, v};
  }
}

/// Whether two images have the same width and height.
template <ImageLike A, ImageLike B>
[[nodiscard]] bool same_size(const A& a, const B& b) {
  return a.width() == b.width() && a.height() == b.height();
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
