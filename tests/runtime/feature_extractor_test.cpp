// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/feature_extractor.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// Random rectangles: strong texture on the left half, faint on the right.
cv::Mat uneven_texture() {
  cv::RNG rng(7);
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < 1500; ++i) {
    const cv::Point p(rng.uniform(0, 640), rng.uniform(0, 480));
    const int contrast = p.x < 320 ? 100 : 16;
    cv::rectangle(image, cv::Rect(p.x, p.y, rng.uniform(5, 30), rng.uniform(5, 30)),
                  cv::Scalar(128 + rng.uniform(-contrast, contrast)), cv::FILLED);
  }
  return image;
}

}  // namespace

TEST_CASE("features cover weakly textured parts of the image too") {
  FeatureExtractor extractor{FeatureOptions{}};
  ImageFeatures found;
  extractor.extract(uneven_texture(), found);
  const auto& [keypoints, descriptors, pyramid] = found;
  CHECK(pyramid.levels.size() == 8);
  REQUIRE(keypoints.size() == descriptors.size());
  CHECK(keypoints.size() > 600);
  CHECK(keypoints.size() < 1400);
  const auto right =
      std::count_if(keypoints.begin(), keypoints.end(), [](const cv::KeyPoint& k) { return k.pt.x > 340; });
  CHECK(right > static_cast<long>(keypoints.size() / 4));
}

TEST_CASE("extraction depends on the image alone") {
  FeatureExtractor a{FeatureOptions{}}, b{FeatureOptions{}};
  ImageFeatures fa, fb;
  const cv::Mat image = uneven_texture();
  a.extract(image, fa);
  a.extract(cv::Mat::zeros(480, 640, CV_8UC1), fb);
  CHECK(fb.keypoints.empty());
  a.extract(image, fa);
  b.extract(image, fb);
  REQUIRE(fa.keypoints.size() == fb.keypoints.size());
  CHECK(fa.descriptors == fb.descriptors);
  for (std::size_t i = 0; i < fa.keypoints.size(); ++i) CHECK(fa.keypoints[i].pt == fb.keypoints[i].pt);
}

TEST_CASE("what lies around an image in memory does not change what is found in it") {
  FeatureExtractor extractor{FeatureOptions{}};
  ImageFeatures alone, part;
  const cv::Mat image = uneven_texture();
  cv::Mat larger(image.rows + 64, image.cols + 64, CV_8UC1, cv::Scalar(0));
  const cv::Mat view = larger(cv::Rect(32, 32, image.cols, image.rows));
  image.copyTo(view);
  extractor.extract(image, alone);
  extractor.extract(view, part);
  REQUIRE(alone.keypoints.size() == part.keypoints.size());
  CHECK(alone.descriptors == part.descriptors);
}

TEST_CASE("descriptors follow a rotation of the image by 90 degrees") {
  FeatureExtractor extractor{FeatureOptions{}};
  ImageFeatures f0, f1;
  const cv::Mat image = uneven_texture();
  cv::Mat turned;
  cv::rotate(image, turned, cv::ROTATE_90_CLOCKWISE);
  extractor.extract(image, f0);
  extractor.extract(turned, f1);
  const auto &k0 = f0.keypoints, &k1 = f1.keypoints;
  const auto &d0 = f0.descriptors, &d1 = f1.descriptors;
  int right = 0, matched = 0;
  for (std::size_t i = 0; i < k0.size(); ++i) {
    std::size_t best = 0;
    int distance = 257;
    for (std::size_t j = 0; j < k1.size(); ++j) {
      const int d = hamming_distance(d0[i], d1[j]);
      if (d < distance) {
        distance = d;
        best = j;
      }
    }
    if (distance > 30) continue;
    ++matched;
    const cv::Point2f expected(479.0F - k0[i].pt.y, k0[i].pt.x);
    right +=
        cv::norm(k1[best].pt - expected) < 3.0 * static_cast<double>(extractor.scale(k0[i].octave)) ? 1 : 0;
  }
  CHECK(matched > 100);
  CHECK(right > matched * 9 / 10);
}
