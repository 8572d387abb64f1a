// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::runtime {

/// One line of a plot.
struct Curve {
  std::string name;
  cv::Scalar colour;  ///< BGR
  std::vector<cv::Point2d> points;
  int thickness = 2;
};

/// Pairs of points joined by thin lines (the differences of a trajectory plot).
struct Segments {
  std::string name;
  cv::Scalar colour;
  std::vector<std::pair<cv::Point2d, cv::Point2d>> pairs;
};

struct PlotOptions {
  std::string title, x_label, y_label;
  bool equal_axes = false;  ///< the same scale in x and y
  bool from_zero = false;   ///< the y axis starts at 0
  cv::Size size{900, 700};
};

/// A line plot with axes, ticks, grid and legend, CV_8UC3.
[[nodiscard]] cv::Mat draw_plot(std::span<const Curve> curves, std::span<const Segments> segments, const PlotOptions& options);

/// Top view of an estimate aligned with the ground truth, with their differences, like the paper's
/// Fig. 5: ground truth black, estimate blue, differences red. The two axes of largest extent are shown.
[[nodiscard]] cv::Mat plot_trajectory(std::span<const StampedPose<double>> estimate, std::span<const StampedPose<double>> groundtruth,
                                      const std::string& title);

/// Error over time of several runs [m against s since the first stamp].
[[nodiscard]] cv::Mat plot_errors(std::span<const std::pair<std::string, AteResult<double>>> runs, const std::string& title);

/// Tints the masked pixels of a picture red, with an outline, and writes a caption.
[[nodiscard]] cv::Mat overlay_mask(const cv::Mat& bgr, const cv::Mat& mask, const std::string& caption);

}  // namespace dynslam::runtime
