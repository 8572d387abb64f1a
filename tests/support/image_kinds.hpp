// SPDX-License-Identifier: BSD-3-Clause
// The kinds of image that every image operation must take, with the same pixels.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "dynslam/image/eigen_view.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam::test {

/// What a user's own image may look like: nothing but the concept, no rows.
template <class T>
struct PlainImage {
  using Pixel = T;
  int w = 0, h = 0;
  std::vector<T> pixels;
  [[nodiscard]] int width() const { return w; }
  [[nodiscard]] int height() const { return h; }
  [[nodiscard]] const T& operator()(int u, int v) const {
    return pixels[std::size_t(u) * std::size_t(h) + std::size_t(v)];
  }
  [[nodiscard]] T& operator()(int u, int v) {
    return pixels[std::size_t(u) * std::size_t(h) + std::size_t(v)];
  }
};
static_assert(MutableImage<PlainImage<float>> && !RowImage<PlainImage<float>>);

/// Each kind makes an image from pixels (`make`), and gives of it what an operation is called with (`in`,
/// `out`).
struct OwnedKind {
  template <class T>
  static Image<T> make(const Image<T>& from) {
    return from;
  }
  template <class T>
  static const Image<T>& in(const Image<T>& image) {
    return image;
  }
  template <class T>
  static Image<T>& out(Image<T>& image) {
    return image;
  }
};
/// A view of a part of a larger image.
struct ViewKind {
  template <class T>
  struct Window {
    Image<T> whole;
    int w, h;
  };
  template <class T>
  static Window<T> make(const Image<T>& from) {
    Window<T> window{Image<T>(from.width() + 3, from.height() + 2), from.width(), from.height()};
    for (int v = 0; v < from.height(); ++v) {
      for (int u = 0; u < from.width(); ++u) window.whole(u + 1, v + 1) = from(u, v);
    }
    return window;
  }
  template <class T>
  static ImageView<const T> in(const Window<T>& image) {
    return {image.whole.data() + image.whole.width() + 1, image.w, image.h, image.whole.width()};
  }
  template <class T>
  static ImageView<T> out(Window<T>& image) {
    return {image.whole.data() + image.whole.width() + 1, image.w, image.h, image.whole.width()};
  }
};
struct PlainKind {
  template <class T>
  static PlainImage<T> make(const Image<T>& from) {
    PlainImage<T> image{from.width(), from.height(),
                        std::vector<T>(std::size_t(from.width()) * std::size_t(from.height()))};
    for (int v = 0; v < from.height(); ++v) {
      for (int u = 0; u < from.width(); ++u) image(u, v) = from(u, v);
    }
    return image;
  }
  template <class T>
  static const PlainImage<T>& in(const PlainImage<T>& image) {
    return image;
  }
  template <class T>
  static PlainImage<T>& out(PlainImage<T>& image) {
    return image;
  }
};
template <int order>
struct EigenKind {
  template <class T>
  using Matrix = Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic, order>;
  template <class T>
  static Matrix<T> make(const Image<T>& from) {
    Matrix<T> m(from.height(), from.width());
    for (int v = 0; v < from.height(); ++v) {
      for (int u = 0; u < from.width(); ++u) m(v, u) = from(u, v);
    }
    return m;
  }
  template <class T>
  static auto in(const Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic, order>& m) {
    return view(m);
  }
  template <class T>
  static auto out(Eigen::Array<T, Eigen::Dynamic, Eigen::Dynamic, order>& m) {
    return view(m);
  }
};
using RowMajorKind = EigenKind<Eigen::RowMajor>;
using ColumnMajorKind = EigenKind<Eigen::ColMajor>;

/// Pixels row by row, whatever the kind.
template <ImageLike I>
[[nodiscard]] std::vector<typename I::Pixel> pixels_of(const I& image) {
  std::vector<typename I::Pixel> out;
  for (int v = 0; v < image.height(); ++v) {
    for (int u = 0; u < image.width(); ++u) out.push_back(image(u, v));
  }
  return out;
}

}  // namespace dynslam::test
