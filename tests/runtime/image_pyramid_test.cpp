// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/image_pyramid.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

cv::Mat texture(test::Rng& rng) {
  cv::Mat image(240, 320, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u)
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(rng.integer(0, 255));
  }
  cv::GaussianBlur(image, image, {0, 0}, 2.0);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

ImagePyramid pyramid_of(const cv::Mat& image) {
  ImagePyramid pyramid;
  for (int level = 0; level < 6; ++level) {
    cv::Mat reduced = image;
    const double s = std::pow(1.2, -level);
    const cv::Size size(cvRound(image.cols * s), cvRound(image.rows * s));
    if (level > 0) cv::resize(image, reduced, size, 0, 0, cv::INTER_AREA);
    pyramid.levels.push_back(reduced);
    pyramid.pixel_size.emplace_back(static_cast<double>(image.cols) / reduced.cols,
                                    static_cast<double>(image.rows) / reduced.rows);
  }
  return pyramid;
}

}  // namespace

TEST_CASE("points are found in a turned, enlarged and shifted image") {
  test::Rng rng("patch matcher");
  const cv::Mat image = texture(rng);
  const ImagePyramid before = pyramid_of(image);
  int tried = 0, found = 0, precise = 0;
  for (const double turn : {0.0, 0.2, -0.3}) {
    for (const double zoom : {1.0, 1.3, 0.8}) {
      Eigen::Matrix2d A;
      A << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
      A *= zoom;
      const Eigen::Vector2d centre(160, 120), shift(3.3, -2.6);
      const Eigen::Vector2d t = centre + shift - A * centre;
      const cv::Mat M = (cv::Mat_<double>(2, 3) << A(0, 0), A(0, 1), t.x(), A(1, 0), A(1, 1), t.y());
      cv::Mat turned;
      cv::warpAffine(image, turned, M, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
      const ImagePyramid after = pyramid_of(turned);
      for (int i = 0; i < 40; ++i) {
        const Eigen::Vector2d x(rng.uniform(110, 210), rng.uniform(80, 160));
        const PointPatch patch = cut_patch<double>(before, x, i % 3);
        REQUIRE(patch.level == i % 3);
        ++tried;
        const Eigen::Vector2d expected = A * x + t;
        const auto match = match_patch<double>(
            after, patch, A, expected + Eigen::Vector2d(rng.uniform(-1, 1), rng.uniform(-1, 1)));
        if (!match) continue;
        ++found;
        precise += (match->x - expected).norm() < 0.2 ? 1 : 0;  // resampled twice, reduced in between
      }
    }
  }
  CHECK(found > tried * 9 / 10);
  CHECK(precise > found * 9 / 10);
}

TEST_CASE("no patch is cut at the border, and one that is missing or seen from behind is not matched") {
  test::Rng rng("patch matcher border");
  const ImagePyramid pyramid = pyramid_of(texture(rng));
  CHECK(cut_patch<double>(pyramid, {5, 100}, 0).level == -1);
  CHECK(cut_patch<double>(pyramid, {100, 238}, 2).level == -1);
  CHECK_FALSE(match_patch<double>(pyramid, PointPatch(), Eigen::Matrix2d::Identity(), {100, 100}));
  const PointPatch patch = cut_patch<double>(pyramid, {100, 100}, 0);
  const auto match = match_patch<double>(pyramid, patch, Eigen::Matrix2d::Identity(), {100.4, 99.7});
  REQUIRE(match);
  CHECK((match->x - Eigen::Vector2d(100, 100)).norm() < 0.02);
  const Eigen::Matrix2d mirrored = Eigen::Vector2d(-1, 1).asDiagonal();
  CHECK_FALSE(match_patch<double>(pyramid, patch, mirrored, {100, 100}));
}
