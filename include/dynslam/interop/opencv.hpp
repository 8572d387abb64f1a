// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <type_traits>

#include <opencv2/core.hpp>

#include "dynslam/config.hpp"
#include "dynslam/image/image_view.hpp"

namespace dynslam::interop {

namespace detail {

/// True when the elements of `m` are of type `T` (depth and number of channels) in two dimensions.
template <class T>
[[nodiscard]] inline bool holds(const cv::Mat& m) {
  return m.dims <= 2 && m.type() == cv::traits::Type<std::remove_const_t<T>>::value &&
         m.step[0] % sizeof(T) == 0;
}

template <class T>
[[nodiscard]] inline std::ptrdiff_t stride(const cv::Mat& m) {
  return static_cast<std::ptrdiff_t>(m.step[0] / sizeof(T));
}

}  // namespace detail

/// View of a cv::Mat, indexed (u, v), without a copy: changes through the view change the matrix. Regions of
/// interest keep their stride. An empty matrix gives a view of 0 x 0.
///
/// The view does not keep the memory alive: it is valid as long as the data of `m` are.
/// Requires: `m` has elements of type `T`, e.g. float for CV_32FC1, cv::Vec3b for CV_8UC3 (asserted).
template <class T>
[[nodiscard]] ImageView<T> view(cv::Mat& m) {
  if (m.empty()) return ImageView<T>(nullptr, 0, 0, 0);
  DYNSLAM_ASSERT(detail::holds<T>(m), "the matrix has elements of another type");
  return ImageView<T>(m.ptr<T>(), m.cols, m.rows, detail::stride<T>(m));
}

/// The same for a matrix that is only read.
template <class T>
[[nodiscard]] ImageView<const T> view(const cv::Mat& m) {
  if (m.empty()) return ImageView<const T>(nullptr, 0, 0, 0);
  DYNSLAM_ASSERT(detail::holds<T>(m), "the matrix has elements of another type");
  return ImageView<const T>(m.ptr<T>(), m.cols, m.rows, detail::stride<T>(m));
}

/// A view of a temporary matrix would outlive it.
template <class T>
ImageView<const T> view(const cv::Mat&& m) = delete;

/// Matrix header over the memory of a view, without a copy; the memory stays with its owner. OpenCV has no
/// read-only matrices, so this takes views through which the image may be changed.
template <class T>
  requires(!std::is_const_v<T>)
[[nodiscard]] cv::Mat as_mat(ImageView<T> image) {
  if (image.width() == 0 || image.height() == 0) return {};
  return cv::Mat(image.height(), image.width(), cv::traits::Type<T>::value, image.data(),
                 static_cast<std::size_t>(image.stride()) * sizeof(T));
}

}  // namespace dynslam::interop

#include "dynslam/pop_macros.hpp"
