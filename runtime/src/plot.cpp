// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace dynslam::runtime {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
const cv::Scalar kBlack(20, 20, 20), kGrid(225, 225, 225), kBlue(200, 90, 20), kRed(60, 60, 225);

void write(cv::Mat& image, const std::string& text, cv::Point at, double scale, const cv::Scalar& colour = kBlack) {
  cv::putText(image, text, at, kFont, scale, colour, 1, cv::LINE_AA);
}

/// Distance between ticks: 1, 2 or 5 times a power of ten, about `wanted` of them.
double tick_step(double range, int wanted) {
  const double raw = range / wanted, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double m : {1.0, 2.0, 5.0}) {
    if (m * power >= raw) return m * power;
  }
  return 10 * power;
}

struct Range {
  double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();
  void add(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
  void widen(double least) {
    if (low > high) low = high = 0;
    const double margin = std::max(0.05 * (high - low), (least - (high - low)) / 2);
    low -= margin;
    high += margin;
  }
};

}  // namespace

cv::Mat draw_plot(std::span<const Curve> curves, std::span<const Segments> segments, const PlotOptions& options) {
  Range x, y;
  for (const Curve& c : curves) {
    for (const auto& p : c.points) {
      x.add(p.x);
      y.add(p.y);
    }
  }
  x.widen(1e-3);
  y.widen(1e-3);
  if (options.from_zero) y.low = 0;
  cv::Mat image(options.size, CV_8UC3, cv::Scalar::all(255));
  const cv::Rect area(90, 55, options.size.width - 120, options.size.height - 125);
  if (options.equal_axes) {
    const double scale = std::max((x.high - x.low) / area.width, (y.high - y.low) / area.height);
    const double dx = scale * area.width - (x.high - x.low), dy = scale * area.height - (y.high - y.low);
    x.low -= dx / 2, x.high += dx / 2, y.low -= dy / 2, y.high += dy / 2;
  }
  constexpr int kShift = 4;  // sub-pixel drawing
  const auto to_pixel = [&](const cv::Point2d& p) {
    return cv::Point2d(area.x + (p.x - x.low) / (x.high - x.low) * area.width, area.y + area.height - (p.y - y.low) / (y.high - y.low) * area.height);
  };
  const auto fixed = [&](const cv::Point2d& p) {
    const cv::Point2d q = to_pixel(p) * (1 << kShift);
    return cv::Point(cvRound(q.x), cvRound(q.y));
  };
  const double sx = tick_step(x.high - x.low, 8), sy = tick_step(y.high - y.low, 7);
  const auto label = [](double v, double step) { return fmt::format("{:.{}f}", std::abs(v) < step * 1e-6 ? 0.0 : v, std::max(0, static_cast<int>(-std::floor(std::log10(step))))); };
  for (double v = std::ceil(x.low / sx) * sx; v <= x.high; v += sx) {
    const int u = cvRound(to_pixel({v, y.low}).x);
    cv::line(image, {u, area.y}, {u, area.y + area.height}, kGrid);
    const std::string text = label(v, sx);
    write(image, text, {u - 5 * static_cast<int>(text.size()), area.y + area.height + 22}, 0.5);
  }
  for (double v = std::ceil(y.low / sy) * sy; v <= y.high; v += sy) {
    const int w = cvRound(to_pixel({x.low, v}).y);
    cv::line(image, {area.x, w}, {area.x + area.width, w}, kGrid);
    const std::string text = label(v, sy);
    write(image, text, {area.x - 10 - 10 * static_cast<int>(text.size()), w + 5}, 0.5);
  }
  cv::rectangle(image, area, kBlack, 1);
  for (const Segments& s : segments) {
    for (const auto& [a, b] : s.pairs) cv::line(image, fixed(a), fixed(b), s.colour, 1, cv::LINE_AA, kShift);
  }
  for (const Curve& c : curves) {
    for (std::size_t i = 1; i < c.points.size(); ++i) cv::line(image, fixed(c.points[i - 1]), fixed(c.points[i]), c.colour, c.thickness, cv::LINE_AA, kShift);
  }
  int row = area.y + 22;
  const auto legend = [&](const std::string& name, const cv::Scalar& colour) {
    const int u = area.x + area.width - 60 - 10 * static_cast<int>(name.size());
    cv::rectangle(image, {u - 6, row - 16}, {area.x + area.width - 4, row + 7}, cv::Scalar::all(255), cv::FILLED);
    cv::line(image, {u, row - 4}, {u + 34, row - 4}, colour, 2, cv::LINE_AA);
    write(image, name, {u + 44, row + 1}, 0.5);
    row += 23;
  };
  for (const Curve& c : curves) legend(c.name, c.colour);
  for (const Segments& s : segments) legend(s.name, s.colour);
  write(image, options.title, {area.x, 35}, 0.7);
  write(image, options.x_label, {area.x + area.width / 2 - 30, options.size.height - 20}, 0.6);
  cv::Mat turned = cv::Mat::zeros(30, 260, CV_8UC3) + cv::Scalar::all(255);
  write(turned, options.y_label, {10, 20}, 0.6);
  cv::rotate(turned, turned, cv::ROTATE_90_COUNTERCLOCKWISE);
  turned.copyTo(image(cv::Rect(4, options.size.height / 2 - 180, 30, 260)));
  return image;
}

cv::Mat plot_trajectory(std::span<const StampedPose<double>> estimate, std::span<const StampedPose<double>> groundtruth,
                        const std::string& title) {
  PlotOptions options;
  options.title = title;
  options.equal_axes = true;
  Curve truth{"ground truth", kBlack, {}, 2}, run{"estimate", kBlue, {}, 2};
  Segments difference{"difference", kRed, {}};
  const auto ate = absolute_trajectory_error<double>(estimate, groundtruth);
  if (!ate) {
    options.title += " (not comparable with the ground truth)";
    return draw_plot({}, {}, options);
  }
  std::vector<double> t_gt, t_est;
  for (const auto& p : groundtruth) t_gt.push_back(p.t);
  for (const auto& p : estimate) t_est.push_back(p.t);
  const auto pairs = associate<double>(t_gt, t_est);
  // The two axes along which the camera moved most.
  Eigen::Vector3d low = groundtruth[pairs.front().first].T_w_c.translation(), high = low;
  for (const auto& [i, j] : pairs) {
    low = low.cwiseMin(groundtruth[i].T_w_c.translation());
    high = high.cwiseMax(groundtruth[i].T_w_c.translation());
  }
  int least = 0;
  (high - low).minCoeff(&least);
  const int a = least == 0 ? 1 : 0, b = least == 2 ? 1 : 2;
  const auto flat = [&](const Eigen::Vector3d& p) { return cv::Point2d(p(a), p(b)); };
  for (const auto& [i, j] : pairs) {
    const Eigen::Vector3d p = groundtruth[i].T_w_c.translation(), q = ate->T_gt_est * estimate[j].T_w_c.translation();
    truth.points.push_back(flat(p));
    run.points.push_back(flat(q));
    difference.pairs.emplace_back(flat(p), flat(q));
  }
  constexpr std::array<const char*, 3> kAxis{"x [m]", "y [m]", "z [m]"};
  options.x_label = kAxis[static_cast<std::size_t>(a)];
  options.y_label = kAxis[static_cast<std::size_t>(b)];
  options.title += fmt::format("   ATE RMSE {:.4f} m", ate->translation.rmse);
  const std::array curves{truth, run};
  const std::array segments{difference};
  return draw_plot(curves, segments, options);
}

cv::Mat plot_errors(std::span<const std::pair<std::string, AteResult<double>>> runs, const std::string& title) {
  const std::array<cv::Scalar, 4> colours{kRed, cv::Scalar(40, 160, 40), kBlue, cv::Scalar(150, 40, 150)};
  std::vector<Curve> curves;
  double start = std::numeric_limits<double>::max();
  for (const auto& [name, ate] : runs) {
    if (!ate.times.empty()) start = std::min(start, ate.times.front());
  }
  for (const auto& [name, ate] : runs) {
    Curve curve{name, colours[curves.size() % colours.size()], {}, 2};
    for (std::size_t i = 0; i < ate.times.size(); ++i) curve.points.emplace_back(ate.times[i] - start, ate.errors[i]);
    curves.push_back(std::move(curve));
  }
  PlotOptions options;
  options.title = title;
  options.x_label = "time [s]";
  options.y_label = "position error [m]";
  options.from_zero = true;
  return draw_plot(curves, {}, options);
}

cv::Mat overlay_mask(const cv::Mat& bgr, const cv::Mat& mask, const std::string& caption) {
  cv::Mat tinted = bgr.clone(), out;
  tinted.setTo(cv::Scalar(40, 40, 235), mask);
  cv::addWeighted(bgr, 0.5, tinted, 0.5, 0, out);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(out, contours, -1, cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
  cv::rectangle(out, {0, 0}, {12 + 12 * static_cast<int>(caption.size()), 30}, cv::Scalar(30, 30, 30), cv::FILLED);
  cv::putText(out, caption, {8, 21}, kFont, 0.6, cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
  return out;
}

}  // namespace dynslam::runtime
