// SPDX-License-Identifier: BSD-3-Clause
// Rivals of optimize_pose and pose_consensus: OpenCV's refinement and RANSAC, which use the pixels alone.
#pragma once

#include <cstddef>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose_residual.hpp"

namespace dynslam::baselines {

class OpenCvPose {
 public:
  OpenCvPose(const Pinhole<double>& camera, std::span<const PoseObservation<double>> observations)
      : K_(camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1) {
    cv::setNumThreads(1);
    for (const auto& o : observations) {
      points_.emplace_back(o.p_w.x(), o.p_w.y(), o.p_w.z());
      pixels_.emplace_back(o.x.x(), o.x.y());
    }
  }

  /// solvePnPRefineLM from a guess over all observations.
  [[nodiscard]] SE3d refine(const SE3d& initial) {
    const Eigen::Vector3d angle = initial.so3().log();
    const Eigen::Vector3d& t = initial.translation();
    rotation_ = {angle.x(), angle.y(), angle.z()};
    translation_ = {t.x(), t.y(), t.z()};
    cv::solvePnPRefineLM(points_, pixels_, K_, cv::noArray(), rotation_, translation_);
    return pose();
  }
  /// solvePnPRansac with OpenCV's defaults but for the bound [px]. @param method  cv::SolvePnPMethod or a
  /// method of USAC
  [[nodiscard]] SE3d ransac(int method, double bound) {
    inliers_.clear();
    if (!cv::solvePnPRansac(points_, pixels_, K_, cv::noArray(), rotation_, translation_, false, 100,
                            static_cast<float>(bound), 0.99, inliers_, method)) {
      inliers_.clear();
      return {};
    }
    return pose();
  }
  /// Of the last ransac().
  [[nodiscard]] const std::vector<int>& inliers() const { return inliers_; }

 private:
  [[nodiscard]] SE3d pose() const {
    return SE3d(SO3d::exp(Eigen::Vector3d(rotation_[0], rotation_[1], rotation_[2])),
                Eigen::Vector3d(translation_[0], translation_[1], translation_[2]));
  }
  cv::Matx33d K_;
  std::vector<cv::Point3d> points_;
  std::vector<cv::Point2d> pixels_;
  cv::Vec3d rotation_, translation_;
  std::vector<int> inliers_;
};

}  // namespace dynslam::baselines
