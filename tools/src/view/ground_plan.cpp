// SPDX-License-Identifier: BSD-3-Clause
#include "view/ground_plan.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "view/view_canvas.hpp"

namespace dynslam::runtime::viewing {
namespace {

constexpr int kFraction = 4;        // bits of drawn coordinates
constexpr double kSilent = 0.5;     // seconds without a pose that interrupt a line
constexpr double kSeenTurn = 0.05;  // of the plan's axes [rad]

cv::Point fixed_point(const cv::Point2d& p) {
  constexpr double kFar = 1e5;  // OpenCV's coordinates are ints
  return {cvRound(std::clamp(p.x, -kFar, kFar) * (1 << kFraction)),
          cvRound(std::clamp(p.y, -kFar, kFar) * (1 << kFraction))};
}

}  // namespace

bool PlanAxes::follow(std::span<const StampedPose<double>> trajectory) {
  if (trajectory.empty()) return false;
  Eigen::Vector3d above = Eigen::Vector3d::Zero();
  for (const auto& pose : trajectory) above -= pose.T_w_c.so3().matrix().col(1);
  if (above.norm() < 0.1 * static_cast<double>(trajectory.size())) return false;  // it looked everywhere
  above.normalize();
  Eigen::Vector3d ahead = trajectory.front().T_w_c.so3().matrix().col(2);
  ahead -= above * above.dot(ahead);
  if (ahead.norm() < 0.1) return false;  // straight down: as before
  const Eigen::Vector3d aside = ahead.cross(above).normalized();
  if (above.dot(up) > std::cos(kSeenTurn) && aside.dot(right) > std::cos(kSeenTurn)) return false;
  up = above;
  right = aside;
  front = up.cross(right);
  return true;
}

bool GroundPlan::show(const PlanBox& wanted, cv::Size area) {
  if (wanted.empty()) return false;
  const Eigen::Vector2d extent = wanted.high - wanted.low;
  const bool inside = area == area_ && (wanted.low.array() >= shown_.low.array()).all() &&
                      (wanted.high.array() <= shown_.high.array()).all();
  if (inside && !shown_.empty()) return false;
  constexpr double kRoom = 0.12;  // of its larger side, around what is to be seen
  const double room = kRoom * std::max(extent.maxCoeff(), least_);
  shown_.low = wanted.low.array() - room;
  shown_.high = wanted.high.array() + room;
  centre_ = (shown_.low + shown_.high) / 2;
  area_ = area;
  const Eigen::Vector2d size = (shown_.high - shown_.low).cwiseMax(least_);
  scale_ = std::min(area.width / size.x(), area.height / size.y());
  // All that is on the canvas now may be used before it moves again.
  const Eigen::Vector2d half(area.width / (2 * scale_), area.height / (2 * scale_));
  constexpr double kEdge = 0.97;
  shown_.low = shown_.low.cwiseMin(centre_ - kEdge * half);
  shown_.high = shown_.high.cwiseMax(centre_ + kEdge * half);
  return true;
}

/// 1, 2 or 5 times a power of ten [m], 45 pixels or more.
double GroundPlan::step() const {
  const double least = 45 / scale_, power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double m : {1.0, 2.0, 5.0}) {
    if (m * power >= least) return m * power;
  }
  return 10 * power;
}

void GroundPlan::draw_grid(cv::Mat& canvas) const {
  const double metres = step();
  const Eigen::Vector2d half(area_.width / (2 * scale_), area_.height / (2 * scale_));
  const auto first = [&](double low) { return std::ceil(low / metres) * metres; };
  for (double x = first(centre_.x() - half.x()); x <= centre_.x() + half.x(); x += metres) {
    const int u = cvRound(pixel({x, 0}).x);
    cv::line(canvas, {u, 0}, {u, area_.height}, kLine * 0.6);
  }
  for (double y = first(centre_.y() - half.y()); y <= centre_.y() + half.y(); y += metres) {
    const int v = cvRound(pixel({0, y}).y);
    cv::line(canvas, {0, v}, {area_.width, v}, kLine * 0.6);
  }
}

void GroundPlan::draw_bar(cv::Mat& canvas) const {
  const double metres = step();
  const std::string text = metres >= 1      ? fmt::format("{:g} m", metres)
                           : metres >= 0.01 ? fmt::format("{:g} cm", 100 * metres)
                                            : fmt::format("{:g} mm", 1000 * metres);
  const int length = cvRound(metres * scale_), left = 8, v = area_.height - 9;
  const cv::Rect back(left - 4, v - 8, length + text_width(text, kSmall) + 18, 15);
  cv::Mat under = canvas(back & cv::Rect({0, 0}, canvas.size()));
  under *= 0.35;  // the map may be of any colour
  cv::line(canvas, {left, v}, {left + length, v}, kInk, 1);
  for (const int u : {left, left + length}) cv::line(canvas, {u, v - 3}, {u, v + 3}, kInk, 1);
  write(canvas, text, {left, v - 8, 1, 16}, left + length + 7, kSmall, kInk);
}

void GroundPlan::draw_path(cv::Mat& canvas, const PlanAxes& axes, std::span<const StampedPose<double>> path,
                           const cv::Scalar& colour, int thickness) const {
  std::vector<cv::Point> line;
  const auto end = [&] {
    if (line.size() == 1) line.push_back(line.front());
    if (!line.empty()) cv::polylines(canvas, line, false, colour, thickness, cv::LINE_AA, kFraction);
    line.clear();
  };
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (i > 0 && path[i].t - path[i - 1].t > kSilent) end();
    const cv::Point p = fixed_point(pixel(axes.flat(path[i].T_w_c.translation())));
    if (line.empty() || p != line.back()) line.push_back(p);
  }
  end();
}

void GroundPlan::draw_camera(cv::Mat& canvas, const PlanAxes& axes, const SE3<double>& T_w_c,
                             const cv::Scalar& colour) const {
  constexpr double kLength = 20, kHalfWidth = 0.55;  // of what it looks at [px], [tan]
  const cv::Point2d at = pixel(axes.flat(T_w_c.translation()));
  Eigen::Vector2d view = axes.flat(T_w_c.so3().matrix().col(2));
  if (view.norm() < 0.1) view = axes.flat(-T_w_c.so3().matrix().col(1));  // it looks down
  if (view.norm() > 1e-6) view.normalize();
  const cv::Point2d ahead(kLength * view.x(), -kLength * view.y()), aside(-ahead.y, ahead.x);
  const std::array<cv::Point, 3> wedge{fixed_point(at), fixed_point(at + ahead + kHalfWidth * aside),
                                       fixed_point(at + ahead - kHalfWidth * aside)};
  cv::polylines(canvas, wedge, true, colour, 1, cv::LINE_AA, kFraction);
  cv::circle(canvas, fixed_point(at), 4 << kFraction, colour, cv::FILLED, cv::LINE_AA, kFraction);
}

}  // namespace dynslam::runtime::viewing
