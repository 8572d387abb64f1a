// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/plot.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

using dynslam::SE3;
using dynslam::SO3;
using dynslam::StampedPose;
using namespace dynslam::runtime;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const cv::Scalar kMagenta(255, 0, 255);
const cv::Rect kInside(97, 82, 900 - 129, 700 - 154);  // of the plotted area's frame

cv::Mat where(const cv::Mat& image, const cv::Scalar& low, const cv::Scalar& high) {
  cv::Mat mask;
  cv::inRange(image, low, high, mask);
  return mask;
}
cv::Mat magenta(const cv::Mat& plot) {
  return where(plot(kInside), {200, 0, 200}, {255, 60, 255});
}
int red_pixels(const cv::Mat& plot) {
  return cv::countNonZero(where(plot(kInside), {0, 0, 180}, {150, 150, 255}));
}
int blue_pixels(const cv::Mat& plot) {
  return cv::countNonZero(where(plot(kInside), {150, 60, 0}, {255, 160, 110}));
}

/// Three quarters of a circle of 1 m, 30 poses per second.
std::vector<StampedPose<double>> arc(double error) {
  std::vector<StampedPose<double>> poses;
  for (int i = 0; i < 120; ++i) {
    const double angle = i * 0.04, radius = 1.0 + error * std::sin(7 * angle);
    poses.push_back({i / 30.0, SE3<double>(SO3<double>(),
                                           {radius * std::cos(angle), radius * std::sin(angle), 0.01 * i})});
  }
  return poses;
}

}  // namespace

TEST_CASE("a point that is not finite interrupts the line") {
  PlotOptions options;
  const std::array whole{Curve{"a", kMagenta, {{0, 0}, {1, 1}, {2, 1}, {3, 0}}, 2}};
  const std::array broken{Curve{"a", kMagenta, {{0, 0}, {1, 1}, {kNaN, kNaN}, {2, 1}, {3, 0}}, 2}};
  const int middle = kInside.width / 2;
  CHECK(cv::countNonZero(magenta(draw_plot(whole, {}, options)).col(middle)) > 0);
  const cv::Mat mask = magenta(draw_plot(broken, {}, options));
  CHECK(cv::countNonZero(mask.col(middle)) == 0);
  CHECK(cv::countNonZero(mask) > 100);
}

TEST_CASE("equal axes keep a square square") {
  PlotOptions options;
  options.equal_axes = true;
  const std::array square{Curve{"a", kMagenta, {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}}, 1}};
  const cv::Rect box = cv::boundingRect(magenta(draw_plot(square, {}, options)));
  CHECK(std::abs(box.width - box.height) <= 2);
  CHECK(box.width > 400);
}

TEST_CASE("a logarithmic axis spaces decades evenly and leaves out what has no logarithm") {
  PlotOptions options;
  options.log_y = true;
  const auto height_of = [&](double value) {
    const std::array curves{Curve{"range", {0, 255, 255}, {{0, 0.001}, {0.5, 10.0}}, 1},
                            Curve{"a", kMagenta, {{0.6, value}, {1.0, value}, {1.1, 0.0}, {1.2, -1.0}}, 1}};
    const cv::Mat mask = magenta(draw_plot(curves, {}, options));
    REQUIRE(cv::countNonZero(mask) > 50);
    const cv::Rect box = cv::boundingRect(mask);
    CHECK(box.height <= 3);
    return box.y;
  };
  const int a = height_of(0.01), b = height_of(0.1), c = height_of(1.0);
  CHECK(b < a);
  CHECK(std::abs((a - b) - (b - c)) <= 2);
}

TEST_CASE("plots of nothing are still plots") {
  CHECK(draw_plot({}, {}, {}).size() == cv::Size(900, 700));
  CHECK(plot_trajectory({}, {}, "empty").size() == cv::Size(900, 700));
  CHECK(plot_errors({}, "empty").size() == cv::Size(900, 700));
  const std::array point{Curve{"a", kMagenta, {{5, 5}}, 1}};
  CHECK(draw_plot(point, {}, {}).size() == cv::Size(900, 700));
}

TEST_CASE("a trajectory plot aligns the estimate and shows differences in red") {
  const auto truth = arc(0);
  auto moved = truth, wrong = arc(0.1);
  const SE3<double> T(SO3<double>::exp({0.3, -1, 2}), {4, -5, 6});
  for (auto& pose : moved) pose.T_w_c = T * pose.T_w_c;
  for (auto& pose : wrong) pose.T_w_c = T * pose.T_w_c;
  const cv::Mat same = plot_trajectory(moved, truth, "same"),
                different = plot_trajectory(wrong, truth, "different");
  CHECK(blue_pixels(same) > 500);
  CHECK(red_pixels(same) < 50);
  CHECK(red_pixels(different) > 1000);
}

TEST_CASE("time without a pose is a gap in the estimate, not in the ground truth") {
  const auto truth = arc(0);
  auto estimate = truth;
  estimate.erase(estimate.begin() + 40, estimate.begin() + 80);
  const cv::Mat plot = plot_trajectory(estimate, truth, "gap");
  const int whole = blue_pixels(plot_trajectory(truth, truth, "whole"));
  CHECK(blue_pixels(plot) < 0.75 * whole);
  CHECK(cv::countNonZero(where(plot(kInside), {0, 0, 0}, {60, 60, 60})) > 300);  // the truth bridges the gap
}

TEST_CASE("an estimate that cannot be aligned leaves the ground truth") {
  const auto truth = arc(0);
  const std::vector<StampedPose<double>> other{{1000.0, SE3<double>()}};
  const cv::Mat plot = plot_trajectory(other, truth, "other");
  CHECK(blue_pixels(plot) == 0);
  CHECK(cv::countNonZero(where(plot(kInside), {0, 0, 0}, {60, 60, 60})) > 500);
}

TEST_CASE("an overlay reddens the mask and nothing else") {
  const cv::Mat picture(40, 60, CV_8UC3, cv::Scalar(100, 100, 100));
  cv::Mat mask = cv::Mat::zeros(40, 60, CV_8UC1);
  mask(cv::Rect(10, 10, 20, 20)) = 255;
  const cv::Mat out = overlay_mask(picture, mask);
  CHECK(out.at<cv::Vec3b>(5, 50) == cv::Vec3b(100, 100, 100));
  const cv::Vec3b inside = out.at<cv::Vec3b>(20, 20);
  CHECK(inside[2] > inside[0] + 60);
  CHECK(picture.at<cv::Vec3b>(20, 20) == cv::Vec3b(100, 100, 100));
}

TEST_CASE("a missing picture leaves its place empty and moves no other") {
  const cv::Mat green(48, 64, CV_8UC3, cv::Scalar(0, 255, 0)), blue(48, 64, CV_8UC3, cv::Scalar(255, 0, 0));
  const std::vector<SheetRow> rows{{"first", {green, cv::Mat(), blue}}, {"second", {}}};
  const std::vector<std::string> captions{"1 s", "2 s", "3 s"};
  const cv::Mat sheet = contact_sheet(rows, captions, 64);
  const auto centre = [&](int row, int column) {
    return sheet.at<cv::Vec3b>(34 + row * 54 + 24, 40 + column * 70 + 32);
  };
  CHECK(centre(0, 0) == cv::Vec3b(0, 255, 0));
  CHECK(centre(0, 1) == cv::Vec3b(225, 225, 225));
  CHECK(centre(0, 2) == cv::Vec3b(255, 0, 0));
  CHECK(centre(1, 2) == cv::Vec3b(225, 225, 225));
  CHECK_FALSE(contact_sheet({}, {}, 64).empty());
}
