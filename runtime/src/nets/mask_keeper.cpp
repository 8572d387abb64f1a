// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/mask_keeper.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>

#include "dynslam/image/depth.hpp"
#include "io/argument_check.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kSmallest = 80;  // pixels: less is no object

float median_of(std::vector<float>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

cv::Mat square(int radius) {
  return cv::getStructuringElement(cv::MORPH_RECT, {2 * radius + 1, 2 * radius + 1});
}

/// The parts of a mask: by instance where these are known, by connection otherwise.
std::vector<cv::Mat> parts_of(const Masks& masks) {
  std::vector<cv::Mat> parts;
  if (!masks.instances.empty()) {
    double highest = 0;
    cv::minMaxLoc(masks.instances, nullptr, &highest);
    for (int id = 1; id <= static_cast<int>(highest); ++id) {
      cv::Mat part = (masks.instances == id) & (masks.dynamic != 0);
      if (cv::countNonZero(part) >= kSmallest) parts.push_back(std::move(part));
    }
    return parts;
  }
  cv::Mat labels, statistics, centres;
  const int n = cv::connectedComponentsWithStats(masks.dynamic, labels, statistics, centres, 8, CV_32S);
  for (int i = 1; i < n; ++i) {
    if (statistics.at<int>(i, cv::CC_STAT_AREA) >= kSmallest) parts.push_back(labels == i);
  }
  return parts;
}

}  // namespace

void MaskKeeper::refine(cv::Mat& mask, const cv::Mat& depth, float& median) const {
  std::vector<float> values;
  cv::Mat inner;
  cv::erode(mask, inner, square(3));
  for (int v = 0; v < mask.rows; v += 2) {
    for (int u = 0; u < mask.cols; u += 2) {
      const float z = depth.at<float>(v, u);
      if (inner.at<std::uint8_t>(v, u) != 0 && is_valid_depth(z)) values.push_back(z);
    }
  }
  median = values.size() >= 20 ? median_of(values) : 0;
  if (median == 0) return;  // nothing to go by
  std::sort(values.begin(), values.end());
  const float low = values[values.size() / 20] - 0.5F * options_.depth_margin;
  const float high = values[values.size() - 1 - values.size() / 5] + options_.depth_margin;
  cv::Mat reach;
  cv::dilate(mask, reach, square(options_.band));
  for (int v = 0; v < mask.rows; ++v) {
    auto* m = mask.ptr<std::uint8_t>(v);
    const auto* r = reach.ptr<std::uint8_t>(v);
    const auto* i = inner.ptr<std::uint8_t>(v);
    const auto* z = depth.ptr<float>(v);
    for (int u = 0; u < mask.cols; ++u) {
      if (r[u] == 0 || !is_valid_depth(z[u])) continue;
      const bool own = z[u] > low && z[u] < high;
      // Inside, the network is trusted; at its rim and around it, depth is.
      if (i[u] == 0) m[u] = own ? 255 : (z[u] >= high ? 0 : m[u]);
    }
  }
}

bool MaskKeeper::outdated(Kept& kept, double t) const {
  if (options_.max_seconds > 0) return t - kept.seen > options_.max_seconds;
  return ++kept.age > options_.max_age;
}

bool MaskKeeper::carry(Kept& kept, const cv::Mat& gray, const cv::Mat& depth) const {
  if (gray_.empty()) return false;
  std::vector<cv::Point2f> from, to;
  cv::goodFeaturesToTrack(gray_, from, options_.points, 0.005, 5, kept.mask);
  if (static_cast<int>(from.size()) < options_.min_points) return false;
  std::vector<std::uint8_t> found;
  cv::calcOpticalFlowPyrLK(gray_, gray, from, to, found, cv::noArray(), {21, 21}, 3);
  std::vector<float> du, dv;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (found[i] == 0) continue;
    du.push_back(to[i].x - from[i].x);
    dv.push_back(to[i].y - from[i].y);
  }
  if (static_cast<int>(du.size()) < options_.min_points) return false;
  const cv::Point2f shift(median_of(du), median_of(dv));
  const cv::Matx23f M(1, 0, shift.x, 0, 1, shift.y);
  cv::Mat moved, most;
  cv::warpAffine(kept.mask, moved, M, kept.mask.size(), cv::INTER_NEAREST);
  cv::warpAffine(kept.reach, most, M, kept.reach.size(), cv::INTER_NEAREST);

  std::vector<float> values;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (found[i] == 0) continue;
    const int u = cvRound(from[i].x + shift.x), v = cvRound(from[i].y + shift.y);
    if (u < 0 || v < 0 || u >= depth.cols || v >= depth.rows) continue;
    const float z = depth.at<float>(v, u);
    if (is_valid_depth(z) && (kept.depth == 0 || std::abs(z - kept.depth) < options_.depth_margin))
      values.push_back(z);
  }
  if (static_cast<int>(values.size()) < options_.min_points) return false;  // something else is there now
  const float now = median_of(values);
  cv::Mat reach;
  cv::dilate(moved, reach, square(options_.band));
  cv::bitwise_and(reach, most, reach);
  for (int v = 0; v < moved.rows; ++v) {
    auto* m = moved.ptr<std::uint8_t>(v);
    const auto* r = reach.ptr<std::uint8_t>(v);
    const auto* z = depth.ptr<float>(v);
    for (int u = 0; u < moved.cols; ++u) {
      if (r[u] == 0 || !is_valid_depth(z[u])) continue;
      m[u] = std::abs(z[u] - now) < options_.depth_margin ? 255 : 0;
    }
  }
  if (cv::countNonZero(moved) < kSmallest) return false;
  kept.mask = std::move(moved);
  kept.reach = std::move(most);
  kept.depth = now;
  return true;
}

Masks MaskKeeper::update(const std::optional<Masks>& detected, const cv::Mat& gray, const cv::Mat& depth,
                         double t) {
  check_image(gray, gray_.size(), CV_8UC1, "MaskKeeper::update(): the grey image");
  check_image(depth, gray.size(), CV_32FC1, "MaskKeeper::update(): the depth image");
  if (detected) {
    check_image(detected->dynamic, gray.size(), CV_8UC1, "MaskKeeper::update(): the mask");
    check_optional_image(detected->labels, gray.size(), CV_8UC1, "MaskKeeper::update(): the label image");
    check_optional_image(detected->instances, gray.size(), CV_16UC1,
                         "MaskKeeper::update(): the instance image");
  }
  Masks out;
  if (detected) out.labels = detected->labels.clone();
  if (out.labels.empty()) out.labels = cv::Mat::zeros(gray.size(), CV_8UC1);
  std::vector<Kept> next;
  cv::Mat seen = cv::Mat::zeros(gray.size(), CV_8UC1);
  if (detected) {
    for (cv::Mat& part : parts_of(*detected)) {
      Kept k;
      k.seen = t;
      refine(part, depth, k.depth);
      if (cv::countNonZero(part) < kSmallest) continue;
      seen |= part;
      cv::dilate(part, k.reach, square(options_.most_band));
      k.mask = std::move(part);
      next.push_back(std::move(k));
    }
  }
  cv::Mat all = seen.clone();
  carried_ = 0;
  const double area = static_cast<double>(gray.total());
  for (Kept& k : kept_) {
    if (cv::countNonZero(k.mask & seen) > options_.redetected * cv::countNonZero(k.mask)) continue;
    if (outdated(k, t) || !carry(k, gray, depth)) continue;
    if (cv::countNonZero(k.mask & seen) > options_.redetected * cv::countNonZero(k.mask)) continue;
    if (cv::countNonZero(all | k.mask) > options_.max_cover * area) continue;  // it cannot be right
    all |= k.mask;
    ++carried_;
    next.push_back(std::move(k));
  }
  kept_ = std::move(next);
  gray_ = gray;
  out.dynamic = all;
  // What moves never becomes furniture, nor the other way round.
  out.labels.setTo(static_cast<int>(Label::person), all);
  out.instances = cv::Mat::zeros(gray.size(), CV_16UC1);
  for (std::size_t i = 0; i < kept_.size(); ++i)
    out.instances.setTo(static_cast<double>(i + 1), kept_[i].mask);
  return out;
}

}  // namespace dynslam::runtime
