// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <type_traits>

namespace dynslam {

/// A readable image addressed as (u, v) = (column, row); integer coordinates are pixel centres.
/// cv::Mat and Eigen matrices deliberately do not qualify (they are addressed row first): use a view.
template <class I>
concept ImageLike = requires(const I& image, int u, int v) {
  typename I::Pixel;
  { image.width() } -> std::same_as<int>;
  { image.height() } -> std::same_as<int>;
  { image(u, v) } -> std::convertible_to<typename I::Pixel>;
};

/// Depth along the optical axis in metres; invalid = NaN or <= 0.
template <class I>
concept DepthImage = ImageLike<I> && std::floating_point<typename I::Pixel>;

/// Integer labels or masks (nonzero = set).
template <class I>
concept LabelImage = ImageLike<I> && std::integral<typename I::Pixel>;

/// A pointer to pixels of type P, and nothing that merely becomes one: pointers are deduced and counted up.
template <class T, class P>
concept PixelPointer =
    std::same_as<std::remove_cvref_t<T>, P*> || std::same_as<std::remove_cvref_t<T>, const P*>;

/// An image that gives its rows as pointers to contiguous pixels; pixel loops are faster with it, and never
/// need it.
template <class I>
concept RowImage = ImageLike<I> && requires(const I& image, int v) {
  { image.row(v) } -> PixelPointer<typename I::Pixel>;
};

/// An image whose pixels can be assigned.
template <class I>
concept MutableImage = ImageLike<I> && requires(I& image, int u, int v, typename I::Pixel p) {
  image(u, v) = p;
};

/// What a function that writes an image takes as `I&& out`: a mutable image by reference or a view by value.
template <class I>
concept OutputImage = MutableImage<std::remove_reference_t<I>>;
/// The same for labels and masks, and for depth.
template <class I>
concept OutputLabelImage = OutputImage<I> && LabelImage<std::remove_reference_t<I>>;
/// An image of depths that a function fills: any that it can write to.
template <class I>
concept OutputDepthImage = OutputImage<I> && DepthImage<std::remove_reference_t<I>>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
