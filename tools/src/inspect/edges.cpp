// SPDX-License-Identifier: BSD-3-Clause
// Depth edges against colour edges: an object's border is an edge in both images, so the two agree where
// depth is registered to colour and both were taken at the same time.
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "inspect/measure.hpp"

namespace dynslam::runtime::inspect {
namespace {

constexpr int kWorkingWidth = 320;         // pixels; larger images are reduced
constexpr double kEdgeRange = 1.0 / 20;    // largest shift, share of the width
constexpr int kLagRange = 6;               // working pixels around the shift, while lags are compared
constexpr int kLongestLag = 5;             // frames
constexpr std::size_t kEdgePoints = 1500;  // per image
constexpr std::size_t kFewestEdges = 100;  // of all images of one lag
constexpr float kJump = 0.08F;             // of the nearer depth
constexpr int kWidestHole = 6;  // pixels without depth that a jump may have: the projector's shadow

struct Edges {
  cv::Mat colour;                 // CV_32FC1, strength less its mean, over its deviation
  std::vector<cv::Point> points;  // of depth jumps, on the nearer side
};

int reduction(int width) {
  return std::max(1, static_cast<int>(std::lround(double(width) / kWorkingWidth)));
}

cv::Mat colour_edges(const cv::Mat& gray, cv::Size size) {
  cv::Mat small, dx, dy, strength;
  cv::resize(gray, small, size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(small, small, {3, 3}, 0.8);
  cv::Sobel(small, dx, CV_32F, 1, 0);
  cv::Sobel(small, dy, CV_32F, 0, 1);
  cv::magnitude(dx, dy, strength);
  // Strong edges count as one: the border of a lamp is worth no more than that of a cupboard.
  cv::Scalar mean, deviation;
  cv::meanStdDev(strength, mean, deviation);
  cv::min(strength, mean[0] + 2 * deviation[0], strength);
  cv::meanStdDev(strength, mean, deviation);
  strength = (strength - mean[0]) / std::max(1e-3, deviation[0]);
  return strength;
}

/// Jumps along a line of `n` pixels, at(k) their depths; edge(k) is called with the nearer side.
template <class At, class Edge>
void find_jumps(int n, At&& at, Edge&& edge) {
  int last = -1;
  for (int k = 0; k < n; ++k) {
    const float z = at(k);
    if (!(z > 0)) continue;
    if (last >= 0 && k - last <= kWidestHole + 1) {
      const float before = at(last);
      if (std::abs(z - before) > kJump * std::min(z, before)) edge(z < before ? k : last);
    }
    last = k;
  }
}

std::vector<cv::Point> depth_edges(const cv::Mat& depth, int reduce) {
  std::vector<cv::Point> all, some;
  for (int v = 0; v < depth.rows; v += reduce) {
    find_jumps(
        depth.cols, [&](int u) { return depth.at<float>(v, u); },
        [&](int u) { all.emplace_back(u / reduce, v / reduce); });
  }
  for (int u = 0; u < depth.cols; u += reduce) {
    find_jumps(
        depth.rows, [&](int v) { return depth.at<float>(v, u); },
        [&](int v) { all.emplace_back(u / reduce, v / reduce); });
  }
  const std::size_t step = all.size() / kEdgePoints + 1;
  for (std::size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
  return some;
}

/// Where the parabola through a, b, c at -1, 0, 1 is highest.
double top_of(double a, double b, double c) {
  const double bend = a - 2 * b + c;
  return bend < 0 ? 0.5 * (a - c) / bend : 0.0;
}

/// Sums of colour strength at depth points, over shifts within a radius about a centre.
class Agreement {
 public:
  Agreement(cv::Point centre, int radius)
      : centre_(centre), radius_(radius), sum_(2 * radius + 1, 2 * radius + 1, CV_64FC1, cv::Scalar(0)) {}

  void add(const cv::Mat& colour, const std::vector<cv::Point>& points) {
    const int border = radius_ + std::max(std::abs(centre_.x), std::abs(centre_.y));
    const cv::Rect inside(border, border, colour.cols - 2 * border, colour.rows - 2 * border);
    for (const cv::Point& p : points) {
      if (!inside.contains(p)) continue;
      ++count_;
      for (int dy = -radius_; dy <= radius_; ++dy) {
        const float* row = colour.ptr<float>(p.y + centre_.y + dy) + p.x + centre_.x - radius_;
        double* sum = sum_.ptr<double>(dy + radius_);
        for (int dx = 0; dx <= 2 * radius_; ++dx) sum[dx] += double(row[dx]);
      }
    }
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  /// Mean strength per point at a shift.
  [[nodiscard]] double at(cv::Point shift) const {
    const cv::Point k = shift - centre_ + cv::Point(radius_, radius_);
    return sum_.at<double>(k) / static_cast<double>(std::max<std::size_t>(1, count_));
  }
  [[nodiscard]] cv::Point best() const {
    cv::Point at;
    cv::minMaxLoc(sum_, nullptr, nullptr, nullptr, &at);
    return at + centre_ - cv::Point(radius_, radius_);
  }
  /// The top of the parabola through the best shift and its neighbours.
  [[nodiscard]] cv::Point2d refined() const {
    const cv::Point top = best(), k = top - centre_ + cv::Point(radius_, radius_);
    cv::Point2d result(top);
    const auto value = [&](int x, int y) { return sum_.at<double>(y, x); };
    if (k.x > 0 && k.x < 2 * radius_)
      result.x += top_of(value(k.x - 1, k.y), value(k.x, k.y), value(k.x + 1, k.y));
    if (k.y > 0 && k.y < 2 * radius_)
      result.y += top_of(value(k.x, k.y - 1), value(k.x, k.y), value(k.x, k.y + 1));
    return result;
  }

 private:
  cv::Point centre_;
  int radius_;
  cv::Mat sum_;
  std::size_t count_ = 0;
};

using EdgeBurst = std::vector<Edges>;

void add_lag(Agreement& sum, const EdgeBurst& burst, int lag) {
  for (int i = 0; i < static_cast<int>(burst.size()); ++i) {
    const int j = i + lag;
    if (j < 0 || j >= static_cast<int>(burst.size())) continue;
    sum.add(burst[static_cast<std::size_t>(i)].colour, burst[static_cast<std::size_t>(j)].points);
  }
}

}  // namespace

EdgeReport measure_edges(std::span<const Burst> bursts) {
  EdgeReport report;
  std::vector<EdgeBurst> edges;
  int reduce = 1, width = 0;
  for (const Burst& burst : bursts) {
    EdgeBurst& made = edges.emplace_back();
    for (const RgbdFrame& frame : burst) {
      reduce = reduction(frame.gray.cols);
      width = frame.gray.cols / reduce;
      made.push_back(
          {colour_edges(frame.gray, {width, frame.gray.rows / reduce}), depth_edges(frame.depth, reduce)});
    }
  }
  const int radius = std::max(4, static_cast<int>(std::lround(kEdgeRange * width)));
  Agreement pairs({0, 0}, radius);
  for (const EdgeBurst& burst : edges) add_lag(pairs, burst, 0);
  if (pairs.count() < kFewestEdges) return report;
  report.measured = true;

  // Depth that comes late is shifted in every frame by another amount: lags compete each with its best shift.
  const cv::Point centre(std::clamp(pairs.best().x, -radius + kLagRange, radius - kLagRange),
                         std::clamp(pairs.best().y, -radius + kLagRange, radius - kLagRange));
  const auto with_lag = [&](int lag) {
    Agreement sum(centre, kLagRange);
    for (const EdgeBurst& burst : edges) add_lag(sum, burst, lag);
    return sum;
  };
  std::array<double, 2 * kLongestLag + 1> by_lag{};
  const auto score = [&](int lag) -> double& { return by_lag[static_cast<std::size_t>(lag + kLongestLag)]; };
  for (int lag = -kLongestLag; lag <= kLongestLag; ++lag) {
    const Agreement sum = with_lag(lag);
    if (sum.count() >= kFewestEdges) score(lag) = sum.at(sum.best());
    if (score(lag) > score(report.lag)) report.lag = lag;
  }
  constexpr double kSmallest = 1e-3;
  report.lag_gain = score(report.lag) / std::max(kSmallest, score(0));
  report.late = report.lag;
  if (std::abs(report.lag) < kLongestLag)
    report.late += top_of(score(report.lag - 1), score(report.lag), score(report.lag + 1));

  Agreement sum({0, 0}, radius);
  for (const EdgeBurst& burst : edges) add_lag(sum, burst, report.lag);
  const cv::Point2d shift = sum.refined();
  report.shift_x = shift.x * reduce;
  report.shift_y = shift.y * reduce;
  report.shift_gain = sum.at(sum.best()) / std::max(kSmallest, sum.at({0, 0}));
  return report;
}

}  // namespace dynslam::runtime::inspect
