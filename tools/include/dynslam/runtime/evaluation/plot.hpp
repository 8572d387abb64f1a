// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::runtime {

/// One line of a plot; a point that is not finite interrupts it.
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

/// Titles and axes of a plot.
struct PlotOptions {
  std::string title, x_label, y_label;
  bool equal_axes = false;  ///< the same scale in x and y
  bool log_y = false;       ///< logarithmic y axis; values of 0 and below interrupt the line
  cv::Size size{900, 700};
};

/// A line plot with axes, ticks, grid and a legend above the plotted area, CV_8UC3.
[[nodiscard]] cv::Mat draw_plot(std::span<const Curve> curves, std::span<const Segments> segments,
                                const PlotOptions& options);

/// Top view of an estimate aligned with the ground truth, with their differences, like the paper's
/// Fig. 5: ground truth black, estimate blue, differences red. The two axes of largest extent are shown.
/// Where the two cannot be aligned, the ground truth alone is drawn and the title says so.
[[nodiscard]] cv::Mat plot_trajectory(std::span<const StampedPose<double>> estimate,
                                      std::span<const StampedPose<double>> groundtruth,
                                      const std::string& title);

/// Error over time of several runs [m, logarithmic, against s since the first stamp]. Time without a
/// pose is a gap in the line.
[[nodiscard]] cv::Mat plot_errors(std::span<const std::pair<std::string, AteResult<double>>> runs,
                                  const std::string& title);

/// Tints the pixels of a CV_8UC3 picture where the CV_8UC1 mask is not 0 red, with a white outline.
[[nodiscard]] cv::Mat overlay_mask(const cv::Mat& bgr, const cv::Mat& mask);

/// One row of pictures of a contact sheet; an empty picture leaves its place grey.
struct SheetRow {
  std::string caption;
  std::vector<cv::Mat> pictures;  ///< CV_8UC3
};

/// Rows of pictures with a caption per row and per column, like the paper's Fig. 3.
/// @param width  of each picture [px]; the height follows the first picture's shape
[[nodiscard]] cv::Mat contact_sheet(std::span<const SheetRow> rows,
                                    std::span<const std::string> column_captions, int width = 320);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
