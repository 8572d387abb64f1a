// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/fast_corners.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

using namespace dynslam::runtime;

namespace {

/// What OpenCV finds in a part of an image, whose rim it does not search.
std::vector<cv::KeyPoint> reference(const cv::Mat& image, const cv::Rect& part, int threshold) {
  constexpr int kRing = FastCorners::kRing;
  const cv::Point corner(part.x - kRing, part.y - kRing);
  std::vector<cv::KeyPoint> found;
  cv::FAST(image(cv::Rect(corner, cv::Size(part.width + 2 * kRing, part.height + 2 * kRing))), found,
           threshold, true);
  for (cv::KeyPoint& k : found) k.pt += cv::Point2f(corner);
  return found;
}

bool same(const std::vector<FastCorner>& own, const std::vector<cv::KeyPoint>& others) {
  return std::equal(
      own.begin(), own.end(), others.begin(), others.end(), [](const FastCorner& a, const cv::KeyPoint& b) {
        return cv::Point2f(cv::Point(a.u, a.v)) == b.pt && static_cast<float>(a.score) == b.response;
      });
}

/// Compares with OpenCV in the whole image and in random parts of it. @return corners
std::size_t compare(const cv::Mat& image, cv::RNG& rng) {
  constexpr int kRing = FastCorners::kRing;
  const int right = image.cols - kRing, bottom = image.rows - kRing;
  FastCorners fast;
  std::vector<FastCorner> own;
  std::size_t corners = 0;
  for (const int threshold : {0, 1, 7, 20, 90, 255}) {
    cv::Rect part(kRing, kRing, right - kRing, bottom - kRing);
    for (int trial = 0; trial < 6; ++trial) {
      fast.find(image, part, threshold, own);
      const auto others = reference(image, part, threshold);
      CAPTURE(threshold);
      CAPTURE(part.x);
      CAPTURE(part.width);
      CHECK(same(own, others));
      corners += own.size();
      part.x = rng.uniform(kRing, right);
      part.y = rng.uniform(kRing, bottom);
      part.width = rng.uniform(1, right - part.x + 1);
      part.height = rng.uniform(1, bottom - part.y + 1);
    }
  }
  return corners;
}

}  // namespace

TEST_CASE("corners and their scores are OpenCV's") {
  cv::RNG rng(11);
  std::size_t corners = 0;
  for (const int width : {38, 39, 54, 55, 97, 160}) {
    cv::Mat image(64, width, CV_8UC1);
    rng.fill(image, cv::RNG::UNIFORM, 0, 256);
    corners += compare(image, rng);  // noise: every arc is short
    cv::GaussianBlur(image, image, {5, 5}, 1.5);
    corners += compare(image > 128, rng);  // blobs, as strong as can be
    cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
    corners += compare(image, rng);
  }
  CHECK(corners > 1000);
}

TEST_CASE("a part of a larger image has the rows of that one") {
  cv::RNG rng(5);
  cv::Mat image(90, 200, CV_8UC1);
  rng.fill(image, cv::RNG::UNIFORM, 0, 256);
  CHECK(compare(image(cv::Rect(31, 7, 77, 50)), rng) > 0);
}

TEST_CASE("a plain image has no corners") {
  FastCorners fast;
  std::vector<FastCorner> corners{{1, 2, 3}};
  fast.find(cv::Mat(60, 60, CV_8UC1, cv::Scalar(100)), {10, 10, 40, 40}, 0, corners);
  CHECK(corners.empty());
}
