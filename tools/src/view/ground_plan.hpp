// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <span>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::runtime::viewing {

/// Which way is up, and which way is up on the canvas.
struct PlanAxes {
  Eigen::Vector3d up{0, -1, 0}, right{1, 0, 0}, front{0, 0, 1};

  /// By the cameras of a trajectory: up is what they have above them on average, front is where the first one
  /// looks. @return whether they have changed so much that it can be seen
  bool follow(std::span<const StampedPose<double>> trajectory);
  [[nodiscard]] Eigen::Vector2d flat(const Eigen::Vector3d& p_w) const {
    return {right.dot(p_w), front.dot(p_w)};
  }
};

/// A box in a plan [m].
struct PlanBox {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e30), high = -low;
  void add(const Eigen::Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  [[nodiscard]] bool empty() const { return (low.array() > high.array()).any(); }
};

/// A part of the ground on a part of the canvas, at one scale. It moves only when what is to be seen leaves
/// it, so that the picture rests while the camera moves.
class GroundPlan {
 public:
  /// @param least  side of what is shown at least [m]
  explicit GroundPlan(double least) : least_(least) {}
  /// Has a box in view. @return whether the plan moved
  bool show(const PlanBox& wanted, cv::Size area);
  void forget() { shown_ = {}; }

  [[nodiscard]] double scale() const { return scale_; }  ///< pixels per metre
  /// Pixel within the area.
  [[nodiscard]] cv::Point2d pixel(const Eigen::Vector2d& p) const {
    return {area_.width / 2.0 + scale_ * (p.x() - centre_.x()),
            area_.height / 2.0 - scale_ * (p.y() - centre_.y())};
  }
  /// Lines on the ground, and a bar that says how far they are apart. @param canvas  the area
  void draw_grid(cv::Mat& canvas) const;
  void draw_bar(cv::Mat& canvas) const;
  /// A line through the positions, interrupted where no pose is known for long.
  void draw_path(cv::Mat& canvas, const PlanAxes& axes, std::span<const StampedPose<double>> path,
                 const cv::Scalar& colour, int thickness) const;
  /// Where the camera is and looks.
  void draw_camera(cv::Mat& canvas, const PlanAxes& axes, const SE3<double>& T_w_c,
                   const cv::Scalar& colour) const;

 private:
  [[nodiscard]] double step() const;

  double least_, scale_ = 100;
  cv::Size area_;
  PlanBox shown_;
  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();
};

}  // namespace dynslam::runtime::viewing
