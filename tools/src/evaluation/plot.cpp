// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include "io/argument_check.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr int kShift = 4;         // fractional bits of drawn coordinates
constexpr double kLostFor = 0.5;  // seconds without a pose that interrupt a line
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const cv::Scalar kBlack(20, 20, 20), kGrid(225, 225, 225), kBlue(200, 90, 20), kRed(60, 60, 225);

enum class Align { left, centre, right };

int text_width(const std::string& text, double scale) {
  int baseline = 0;
  return cv::getTextSize(text, kFont, scale, 1, &baseline).width;
}

/// Writes text whose left end, middle or right end is at `at`.
void write(cv::Mat& image, const std::string& text, cv::Point at, double scale, Align align = Align::left) {
  if (align != Align::left) at.x -= text_width(text, scale) / (align == Align::centre ? 2 : 1);
  cv::putText(image, text, at, kFont, scale, kBlack, 1, cv::LINE_AA);
}

void write_upwards(cv::Mat& image, const std::string& text, cv::Point centre, double scale) {
  cv::Mat strip(30, text_width(text, scale) + 20, CV_8UC3, cv::Scalar::all(255));
  write(strip, text, {10, 20}, scale);
  cv::rotate(strip, strip, cv::ROTATE_90_COUNTERCLOCKWISE);
  const cv::Rect place(centre.x - strip.cols / 2, centre.y - strip.rows / 2, strip.cols, strip.rows);
  const cv::Rect inside = place & cv::Rect(0, 0, image.cols, image.rows);
  strip(inside - place.tl()).copyTo(image(inside));
}

bool is_finite(const cv::Point2d& p) {
  return std::isfinite(p.x) && std::isfinite(p.y);
}

/// Distance between ticks: 1, 2 or 5 times a power of ten, about `wanted` of them.
double tick_step(double range, int wanted) {
  const double raw = range / wanted, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double m : {1.0, 2.0, 5.0}) {
    if (m * power >= raw) return m * power;
  }
  return 10 * power;
}

struct Tick {
  double at;  // on the axis: the value, or its logarithm
  std::string text;
};

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
  [[nodiscard]] std::vector<Tick> ticks(int wanted) const {
    const double step = tick_step(high - low, wanted);
    const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
    std::vector<Tick> result;
    for (auto k = static_cast<long>(std::ceil(low / step)); static_cast<double>(k) * step <= high; ++k) {
      const double v = static_cast<double>(k) * step;
      result.push_back({v, fmt::format("{:.{}f}", v, decimals)});
    }
    return result;
  }
  /// Of a range of decimal logarithms: 1, 2, 5, 10, 20, ...
  [[nodiscard]] std::vector<Tick> log_ticks() const {
    const bool dense = high - low < 3.5;
    std::vector<Tick> result;
    for (int e = static_cast<int>(std::floor(low)); e <= high; ++e) {
      for (const double m : {1.0, 2.0, 5.0}) {
        const double at = e + std::log10(m);
        if (at < low || at > high || (m > 1 && !dense)) continue;
        result.push_back({at, fmt::format("{:g}", m * std::pow(10.0, e))});
      }
    }
    return result;
  }
};

}  // namespace

cv::Mat draw_plot(std::span<const Curve> curves, std::span<const Segments> segments,
                  const PlotOptions& options) {
  const auto scaled = [&](const cv::Point2d& p) {
    if (!options.log_y) return p;
    return cv::Point2d(p.x, p.y > 0 ? std::log10(p.y) : kNaN);
  };
  Range x, y;
  const auto include = [&](const cv::Point2d& p) {
    const cv::Point2d q = scaled(p);
    if (!is_finite(q)) return;
    x.add(q.x);
    y.add(q.y);
  };
  for (const Curve& c : curves) std::for_each(c.points.begin(), c.points.end(), include);
  for (const Segments& s : segments) {
    for (const auto& [a, b] : s.pairs) {
      include(a);
      include(b);
    }
  }
  x.widen(1e-3);
  y.widen(options.log_y ? 0.5 : 1e-3);
  cv::Mat image(options.size, CV_8UC3, cv::Scalar::all(255));
  const cv::Rect area(95, 80, options.size.width - 125, options.size.height - 150);
  if (options.equal_axes) {
    const double scale = std::max((x.high - x.low) / area.width, (y.high - y.low) / area.height);
    const double dx = scale * area.width - (x.high - x.low), dy = scale * area.height - (y.high - y.low);
    x.low -= dx / 2, x.high += dx / 2, y.low -= dy / 2, y.high += dy / 2;
  }
  const auto u_of = [&](double v) { return area.x + (v - x.low) / (x.high - x.low) * area.width; };
  const auto v_of = [&](double v) {
    return area.y + area.height - (v - y.low) / (y.high - y.low) * area.height;
  };
  for (const Tick& tick : x.ticks(8)) {
    const int u = cvRound(u_of(tick.at));
    cv::line(image, {u, area.y}, {u, area.br().y}, kGrid);
    write(image, tick.text, {u, area.br().y + 22}, 0.5, Align::centre);
  }
  for (const Tick& tick : options.log_y ? y.log_ticks() : y.ticks(7)) {
    const int v = cvRound(v_of(tick.at));
    cv::line(image, {area.x, v}, {area.br().x, v}, kGrid);
    write(image, tick.text, {area.x - 8, v + 5}, 0.5, Align::right);
  }
  cv::rectangle(image, area, kBlack, 1);

  const auto line = [&](const cv::Point2d& a, const cv::Point2d& b, const cv::Scalar& colour, int thickness) {
    const cv::Point2d p = scaled(a), q = scaled(b);
    if (!is_finite(p) || !is_finite(q)) return;
    const auto fixed = [&](const cv::Point2d& r) {
      return cv::Point(cvRound(u_of(r.x) * (1 << kShift)), cvRound(v_of(r.y) * (1 << kShift)));
    };
    cv::line(image, fixed(p), fixed(q), colour, thickness, cv::LINE_AA, kShift);
  };
  for (const Segments& s : segments) {
    for (const auto& [a, b] : s.pairs) line(a, b, s.colour, 1);
  }
  for (const Curve& c : curves) {
    for (std::size_t i = 1; i < c.points.size(); ++i)
      line(c.points[i - 1], c.points[i], c.colour, c.thickness);
  }

  int u = area.x;
  const auto legend = [&](const std::string& name, const cv::Scalar& colour, int thickness) {
    cv::line(image, {u, area.y - 18}, {u + 34, area.y - 18}, colour, thickness, cv::LINE_AA);
    write(image, name, {u + 42, area.y - 13}, 0.5);
    u += 42 + text_width(name, 0.5) + 30;
  };
  for (const Curve& c : curves) legend(c.name, c.colour, 2);
  for (const Segments& s : segments) legend(s.name, s.colour, 1);
  write(image, options.title, {area.x, 35}, 0.65);
  write(image, options.x_label, {area.x + area.width / 2, options.size.height - 20}, 0.6, Align::centre);
  write_upwards(image, options.y_label, {20, area.y + area.height / 2}, 0.6);
  return image;
}

cv::Mat plot_trajectory(std::span<const StampedPose<double>> estimate,
                        std::span<const StampedPose<double>> groundtruth, const std::string& title) {
  PlotOptions options;
  options.title = title;
  options.equal_axes = true;
  Curve truth{"ground truth", kBlack, {}, 2}, run{"estimate", kBlue, {}, 2};
  Segments difference{"difference", kRed, {}};
  const auto ate = absolute_trajectory_error<double>(estimate, groundtruth);

  // Ground truth of the time that the estimate covers.
  std::vector<StampedPose<double>> covered;
  for (const auto& pose : groundtruth) {
    if (!ate || (pose.t >= estimate.front().t - 0.02 && pose.t <= estimate.back().t + 0.02))
      covered.push_back(pose);
  }
  if (covered.empty()) covered.push_back({});
  // The two axes along which the camera moved most.
  Eigen::Vector3d low = covered.front().T_w_c.translation(), high = low;
  for (const auto& pose : covered) {
    low = low.cwiseMin(pose.T_w_c.translation());
    high = high.cwiseMax(pose.T_w_c.translation());
  }
  int least = 0;
  (high - low).minCoeff(&least);
  const int a = least == 0 ? 1 : 0, b = least == 2 ? 1 : 2;
  constexpr std::array<const char*, 3> kAxis{"x [m]", "y [m]", "z [m]"};
  options.x_label = kAxis[static_cast<std::size_t>(a)];
  options.y_label = kAxis[static_cast<std::size_t>(b)];
  const auto flat = [&](const Eigen::Vector3d& p) { return cv::Point2d(p(a), p(b)); };
  for (const auto& pose : covered) truth.points.push_back(flat(pose.T_w_c.translation()));
  if (!ate) {
    options.title += ": cannot be aligned with the ground truth";
    const std::array curves{truth};
    return draw_plot(curves, {}, options);
  }
  options.title += fmt::format(": ATE RMSE {:.4f} m", ate->translation.rmse);

  const auto t_gt = detail::stamps(groundtruth), t_est = detail::stamps(estimate);
  for (const auto& [i, j] : associate(t_gt, t_est)) {
    difference.pairs.emplace_back(flat(groundtruth[i].T_w_c.translation()),
                                  flat(ate->T_gt_est * estimate[j].T_w_c.translation()));
  }
  for (std::size_t j = 0; j < estimate.size(); ++j) {
    if (j > 0 && estimate[j].t - estimate[j - 1].t > kLostFor) run.points.emplace_back(kNaN, kNaN);
    run.points.push_back(flat(ate->T_gt_est * estimate[j].T_w_c.translation()));
  }
  const std::array curves{truth, run};
  const std::array segments{difference};
  return draw_plot(curves, segments, options);
}

cv::Mat plot_errors(std::span<const std::pair<std::string, AteResult<double>>> runs,
                    const std::string& title) {
  const std::array<cv::Scalar, 4> colours{kRed, cv::Scalar(40, 160, 40), kBlue, cv::Scalar(150, 40, 150)};
  std::vector<Curve> curves;
  double start = std::numeric_limits<double>::max();
  for (const auto& [name, ate] : runs) {
    if (!ate.times.empty()) start = std::min(start, ate.times.front());
  }
  for (const auto& [name, ate] : runs) {
    Curve curve{name, colours[curves.size() % colours.size()], {}, 1};
    for (std::size_t i = 0; i < ate.times.size(); ++i) {
      if (i > 0 && ate.times[i] - ate.times[i - 1] > kLostFor) curve.points.emplace_back(kNaN, kNaN);
      curve.points.emplace_back(ate.times[i] - start,
                                std::max(ate.errors[i], 1e-4));  // below 0.1 mm means nothing
    }
    curves.push_back(std::move(curve));
  }
  PlotOptions options;
  options.title = title + ": position error after alignment";
  options.x_label = "time [s]";
  options.y_label = "position error [m]";
  options.log_y = true;
  return draw_plot(curves, {}, options);
}

cv::Mat overlay_mask(const cv::Mat& bgr, const cv::Mat& mask) {
  check_image(bgr, {}, CV_8UC3, "overlay_mask(): the image");
  check_image(mask, bgr.size(), CV_8UC1, "overlay_mask(): the mask");
  cv::Mat tinted = bgr.clone(), out;
  tinted.setTo(cv::Scalar(40, 40, 235), mask);
  cv::addWeighted(bgr, 0.5, tinted, 0.5, 0, out);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::drawContours(out, contours, -1, cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
  return out;
}

cv::Mat contact_sheet(std::span<const SheetRow> rows, std::span<const std::string> column_captions,
                      int width) {
  constexpr int kGap = 6, kLeft = 40, kTop = 34;
  check_argument(width >= 1 && width <= 10000, "contact_sheet(): the width must be from 1 to 10000 px");
  for (const SheetRow& row : rows) {
    for (const cv::Mat& picture : row.pictures)
      check_optional_image(picture, {}, CV_8UC3, "contact_sheet(): a picture");
  }
  int height = width * 3 / 4;
  std::size_t columns = column_captions.size();
  bool shaped = false;
  for (const SheetRow& row : rows) {
    columns = std::max(columns, row.pictures.size());
    for (const cv::Mat& picture : row.pictures) {
      if (shaped || picture.empty()) continue;
      height = std::max(1, width * picture.rows / picture.cols);
      shaped = true;
    }
  }
  const auto place = [&](std::size_t row, std::size_t column) {
    return cv::Rect(kLeft + static_cast<int>(column) * (width + kGap),
                    kTop + static_cast<int>(row) * (height + kGap), width, height);
  };
  const cv::Point corner = place(rows.size(), columns).tl();
  cv::Mat sheet(std::max(corner.y, kTop + 1), std::max(corner.x, kLeft + 1), CV_8UC3, cv::Scalar::all(255));
  for (std::size_t c = 0; c < column_captions.size(); ++c) {
    write(sheet, column_captions[c], {place(0, c).x + width / 2, kTop - 12}, 0.55, Align::centre);
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const cv::Rect first = place(r, 0);
    write_upwards(sheet, rows[r].caption, {kLeft / 2, first.y + height / 2}, 0.6);
    for (std::size_t c = 0; c < columns; ++c) {
      cv::Mat cell = sheet(place(r, c));
      if (c >= rows[r].pictures.size() || rows[r].pictures[c].empty()) {
        cell.setTo(cv::Scalar::all(225));
      } else {
        cv::resize(rows[r].pictures[c], cell, cell.size(), 0, 0, cv::INTER_AREA);
      }
    }
  }
  return sheet;
}

}  // namespace dynslam::runtime
