// SPDX-License-Identifier: BSD-3-Clause
// F and H by OpenCV's sampling loops, RANSAC and USAC, from matches that are already cv::Point2f.
#pragma once

#include <vector>

#include <opencv2/calib3d.hpp>

#include "support/two_view_scenes.hpp"

namespace dynslam::bench {

struct OpenCvMatches {
  std::vector<cv::Point2f> x, x_m;
  template <class S>
  explicit OpenCvMatches(const TwoViewScene<S>& scene) {
    for (std::size_t i = 0; i < scene.x.size(); ++i) {
      x.emplace_back(static_cast<float>(scene.x[i].x()), static_cast<float>(scene.x[i].y()));
      x_m.emplace_back(static_cast<float>(scene.x_m[i].x()), static_cast<float>(scene.x_m[i].y()));
    }
  }
};

/// @param method  cv::FM_RANSAC or cv::USAC_DEFAULT and its fellows
/// @param inlier  out: one flag per match
inline void opencv_fundamental(const OpenCvMatches& m, int method, double threshold_px, int iterations,
                               std::vector<std::uint8_t>& inlier) {
  inlier.assign(m.x.size(), 0);
  const cv::Mat F = cv::findFundamentalMat(m.x, m.x_m, method, threshold_px, 0.99, iterations, inlier);
  if (F.empty()) inlier.assign(m.x.size(), 0);
}
inline void opencv_homography(const OpenCvMatches& m, int method, double threshold_px, int iterations,
                              std::vector<std::uint8_t>& inlier) {
  inlier.assign(m.x.size(), 0);
  const cv::Mat H = cv::findHomography(m.x, m.x_m, method, threshold_px, inlier, iterations, 0.99);
  if (H.empty()) inlier.assign(m.x.size(), 0);
}

}  // namespace dynslam::bench
