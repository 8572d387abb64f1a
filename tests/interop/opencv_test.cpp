// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/interop/opencv.hpp"

#include <cstdint>
#include <type_traits>
#include <utility>

#include <doctest/doctest.h>
#include <opencv2/core.hpp>

#include "dynslam/concepts/image.hpp"
#include "image_operations.hpp"

using dynslam::ImageView;
using dynslam::interop::as_mat;
using dynslam::interop::view;

// A matrix of OpenCV is indexed (row, column): it must not pass for an image that is indexed (u, v).
static_assert(!dynslam::ImageLike<cv::Mat>);
static_assert(!dynslam::ImageLike<cv::Mat1f>);
static_assert(std::is_same_v<decltype(view<float>(std::declval<cv::Mat&>())), ImageView<float>>);
static_assert(std::is_same_v<decltype(view<float>(std::declval<const cv::Mat&>())), ImageView<const float>>);

namespace {

template <class T>
concept ViewsTemporary = requires {
  view<T>(cv::Mat());
};
static_assert(!ViewsTemporary<float>);

/// Matrices of OpenCV, by their views.
struct OpenCvKind {
  template <class T>
  static cv::Mat_<T> make(const dynslam::Image<T>& from) {
    cv::Mat_<T> m(from.height(), from.width());
    for (int v = 0; v < from.height(); ++v) {
      for (int u = 0; u < from.width(); ++u) m(v, u) = from(u, v);
    }
    return m;
  }
  template <class T>
  static ImageView<const T> in(const cv::Mat_<T>& m) {
    return view<T>(static_cast<const cv::Mat&>(m));
  }
  template <class T>
  static ImageView<T> out(cv::Mat_<T>& m) {
    return view<T>(static_cast<cv::Mat&>(m));
  }
};

}  // namespace

TEST_CASE("A view of a matrix is indexed by column and row") {
  cv::Mat m(3, 5, CV_32FC1);
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 5; ++u) m.at<float>(v, u) = static_cast<float>(10 * v + u);
  }
  const ImageView<float> image = view<float>(m);
  CHECK(image.width() == 5);
  CHECK(image.height() == 3);
  CHECK(image(4, 1) == 14.0F);
  image(2, 2) = -1.0F;
  CHECK(m.at<float>(2, 2) == -1.0F);

  const cv::Mat& read_only = m;
  CHECK(view<float>(read_only)(3, 0) == 3.0F);
}

TEST_CASE("A view of a region of interest keeps the stride of the whole") {
  cv::Mat m(6, 8, CV_16UC1, cv::Scalar(0));
  m.at<std::uint16_t>(3, 5) = 77;
  cv::Mat region = m(cv::Rect(4, 2, 3, 3));
  const ImageView<std::uint16_t> image = view<std::uint16_t>(region);
  CHECK(image.width() == 3);
  CHECK(image.stride() == 8);
  CHECK(image(1, 1) == 77);
}

TEST_CASE("A view of colours, of an empty matrix") {
  cv::Mat colour(2, 2, CV_8UC3, cv::Scalar(1, 2, 3));
  CHECK(view<cv::Vec3b>(colour)(1, 1)[2] == 3);

  cv::Mat empty;
  CHECK(view<float>(empty).width() == 0);
  CHECK(view<float>(empty).height() == 0);
}

TEST_CASE("The elements' type is checked by depth and channels") {
  const cv::Mat m(2, 2, CV_8UC3);
  CHECK(dynslam::interop::detail::holds<cv::Vec3b>(m));
  CHECK_FALSE(dynslam::interop::detail::holds<std::uint8_t>(m));
  CHECK_FALSE(dynslam::interop::detail::holds<float>(m));
}

TEST_CASE("A matrix header over a view shares its memory") {
  cv::Mat m(4, 6, CV_32FC1, cv::Scalar(1.5));
  cv::Mat region = m(cv::Rect(1, 1, 3, 2));
  cv::Mat header = as_mat(view<float>(region));
  CHECK(header.rows == 2);
  CHECK(header.cols == 3);
  CHECK(header.type() == CV_32FC1);
  header.at<float>(1, 2) = 9.0F;
  CHECK(m.at<float>(2, 3) == 9.0F);
  CHECK(cv::sum(header)[0] == doctest::Approx(5 * 1.5 + 9.0));
}

TEST_CASE("Every image operation gives on a matrix what it gives on an image") {
  CHECK(dynslam::test::run_image_operations<OpenCvKind>() ==
        dynslam::test::run_image_operations<dynslam::test::OwnedKind>());
}
