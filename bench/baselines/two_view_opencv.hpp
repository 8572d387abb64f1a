// SPDX-License-Identifier: BSD-3-Clause
// F and H by OpenCV's sampling loops, RANSAC and USAC, from matches that are already cv::Point2f.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
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

/// A model as found, zero where there is none.
[[nodiscard]] inline Eigen::Matrix3d opencv_model(const cv::Mat& found, std::vector<std::uint8_t>& inlier,
                                                  std::size_t matches) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  if (found.rows != 3) {
    inlier.assign(matches, 0);
    return M;
  }
  for (int i = 0; i < 9; ++i) M(i / 3, i % 3) = found.at<double>(i / 3, i % 3);
  return M;
}
/// @param method  cv::FM_RANSAC or cv::USAC_DEFAULT and its fellows
/// @param inlier  out: one flag per match
inline Eigen::Matrix3d opencv_fundamental(const OpenCvMatches& m, int method, double threshold_px,
                                          int iterations, std::vector<std::uint8_t>& inlier) {
  inlier.assign(m.x.size(), 0);
  return opencv_model(cv::findFundamentalMat(m.x, m.x_m, method, threshold_px, 0.99, iterations, inlier),
                      inlier, m.x.size());
}
inline Eigen::Matrix3d opencv_homography(const OpenCvMatches& m, int method, double threshold_px,
                                         int iterations, std::vector<std::uint8_t>& inlier) {
  inlier.assign(m.x.size(), 0);
  return opencv_model(cv::findHomography(m.x, m.x_m, method, threshold_px, inlier, iterations, 0.99), inlier,
                      m.x.size());
}
/// F of the essential matrix of a camera.
inline Eigen::Matrix3d opencv_essential(const OpenCvMatches& m, int method, double threshold_px,
                                        int iterations, std::vector<std::uint8_t>& inlier) {
  const Eigen::Matrix3d K = camera<double>().K(), K_inverse = K.inverse();
  inlier.assign(m.x.size(), 0);
  const cv::Matx33d in_opencv(K(0, 0), 0, K(0, 2), 0, K(1, 1), K(1, 2), 0, 0, 1);
  const Eigen::Matrix3d E = opencv_model(
      cv::findEssentialMat(m.x, m.x_m, in_opencv, method, 0.99, threshold_px, iterations, inlier), inlier,
      m.x.size());
  return K_inverse.transpose() * E * K_inverse;
}

}  // namespace dynslam::bench
