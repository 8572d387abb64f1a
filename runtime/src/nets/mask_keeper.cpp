// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/mask_keeper.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>
#include <vector>

#include "dynslam/image/depth.hpp"
#include "io/argument_check.hpp"
#include "median.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kSmallest = 80;  // pixels: less is no object
constexpr int kTrusted = 3;    // pixels from a mask's rim from which the network is trusted
// Motion is measured in an image of about this width: a mask's is the median of many corners', so that more
// pixels tell hardly more.
constexpr int kFlowWidth = 320;
constexpr int kFlowLevels = 2;       // of its pyramid
const cv::Size kFlowWindow(13, 13);  // around a corner
constexpr double kCornerDistance = 3;
// Where a mask has too few corners there, as small ones have: in the image itself, this far around the mask.
constexpr int kFineReach = 48, kFineLevels = 3;
const cv::Size kFineWindow(21, 21);
constexpr double kFineDistance = 3;
constexpr double kCornerQuality = 0.005;  // and the distances: as in cv::goodFeaturesToTrack()

cv::Mat square(int radius) {
  return cv::getStructuringElement(cv::MORPH_RECT, {2 * radius + 1, 2 * radius + 1});
}

/// A rectangle with so many pixels more on each side, as far as the image goes.
cv::Rect grown(const cv::Rect& box, int margin, cv::Size image) {
  return cv::Rect(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin) &
         cv::Rect({0, 0}, image);
}

/// A distance in whole pixels, rounded as cv::warpAffine() does it.
int whole(float distance) {
  return -((cvRound(-1024.0 * static_cast<double>(distance)) + 512) >> 10);
}

/// Whether another matrix refers to the same memory.
bool shared(const std::vector<cv::Mat>& images) {
  return std::any_of(images.begin(), images.end(),
                     [](const cv::Mat& m) { return m.u != nullptr && m.u->refcount > 1; });
}

/// A mask as part of an image of another size, 0 around it.
cv::Mat placed(const cv::Mat& mask, cv::Point at, cv::Size size) {
  cv::Mat image = cv::Mat::zeros(size, CV_8UC1);
  const cv::Rect inside = cv::Rect(at, mask.size()) & cv::Rect({0, 0}, size);
  if (!inside.empty()) mask(inside - at).copyTo(image(inside));
  return image;
}

/// The rectangles of the instances 1 to the highest one; empty ones where there is none.
std::vector<cv::Rect> boxes_of(const cv::Mat& instances, const cv::Mat& dynamic) {
  struct Ends {
    int left = 1 << 30, top = 1 << 30, right = -1, bottom = -1;
  };
  std::vector<Ends> ends;
  for (int v = 0; v < instances.rows; ++v) {
    const auto* id = instances.ptr<std::uint16_t>(v);
    const auto* m = dynamic.ptr<std::uint8_t>(v);
    for (int u = 0; u < instances.cols; ++u) {
      if (id[u] == 0 || m[u] == 0) continue;
      if (id[u] > ends.size()) ends.resize(id[u]);
      Ends& e = ends[id[u] - std::size_t(1)];
      e = {std::min(e.left, u), std::min(e.top, v), std::max(e.right, u), std::max(e.bottom, v)};
    }
  }
  std::vector<cv::Rect> boxes;
  for (const Ends& e : ends)
    boxes.push_back(e.right < 0 ? cv::Rect()
                                : cv::Rect(e.left, e.top, e.right - e.left + 1, e.bottom - e.top + 1));
  return boxes;
}

}  // namespace

std::vector<MaskKeeper::Kept> MaskKeeper::parts_of(const Masks& masks) const {
  // Around a part there must be room for what depth may add to it, and for what it may cover later.
  const int margin = options_.band + options_.most_band + kTrusted;
  const cv::Size size = masks.dynamic.size();
  std::vector<Kept> parts;
  const auto take = [&](const cv::Rect& box, const cv::Mat& image, int id, bool masked) {
    Kept part;
    part.at = grown(box, margin, size);
    part.mask = image(part.at) == id;
    if (masked) part.mask &= masks.dynamic(part.at) != 0;
    if (cv::countNonZero(part.mask) >= kSmallest) parts.push_back(std::move(part));
  };
  if (!masks.instances.empty()) {
    const std::vector<cv::Rect> boxes = boxes_of(masks.instances, masks.dynamic);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      if (!boxes[i].empty()) take(boxes[i], masks.instances, static_cast<int>(i) + 1, true);
    }
    return parts;
  }
  cv::Mat labels, statistics, centres;
  const int n = cv::connectedComponentsWithStats(masks.dynamic, labels, statistics, centres, 8, CV_32S);
  for (int i = 1; i < n; ++i) {
    const auto* s = statistics.ptr<int>(i);
    if (s[cv::CC_STAT_AREA] < kSmallest) continue;
    take({s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH], s[cv::CC_STAT_HEIGHT]}, labels, i,
         false);
  }
  return parts;
}

void MaskKeeper::refine(Kept& part, const cv::Mat& whole_depth) const {
  const cv::Mat depth = whole_depth(part.at);
  cv::Mat& mask = part.mask;
  std::vector<float> values;
  cv::Mat inner;
  cv::erode(mask, inner, square(kTrusted));
  // Every other pixel of the image, wherever the part lies.
  for (int v = part.at.y % 2; v < mask.rows; v += 2) {
    for (int u = part.at.x % 2; u < mask.cols; u += 2) {
      const float z = depth.at<float>(v, u);
      if (inner.at<std::uint8_t>(v, u) != 0 && is_valid_depth(z)) values.push_back(z);
    }
  }
  part.depth = values.size() >= 20 ? median_of(values) : 0;
  if (part.depth == 0) return;  // nothing to go by
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

std::vector<cv::Point2f> MaskKeeper::corners_of(const Kept& kept, const cv::Mat& image, cv::Point origin,
                                                int shrink, double distance) const {
  constexpr int kReach = 4;  // pixels beside a corner that say whether it is one, and more
  // Corners are on the mask; what it may ever cover reaches much further.
  const cv::Rect on = cv::boundingRect(kept.mask);
  if (on.empty()) return {};
  const cv::Rect there = on + kept.at.tl() - origin;
  const cv::Rect small(cv::Point(there.x / shrink, there.y / shrink),
                       cv::Point((there.br().x - 1) / shrink + 1, (there.br().y - 1) / shrink + 1));
  const cv::Rect box = grown(small, 2 * kReach / shrink, image.size());
  cv::Mat mask = cv::Mat::zeros(box.size(), CV_8UC1);
  for (int v = 0; v < box.height; ++v) {
    const int y =
        (v + box.y) * shrink + shrink / 2 + origin.y - kept.at.y;  // the middle of what the pixel shows
    if (y < 0 || y >= kept.mask.rows) continue;
    const auto* row = kept.mask.ptr<std::uint8_t>(y);
    auto* m = mask.ptr<std::uint8_t>(v);
    for (int u = 0; u < box.width; ++u) {
      const int x = (u + box.x) * shrink + shrink / 2 + origin.x - kept.at.x;
      if (x >= 0 && x < kept.mask.cols) m[u] = row[x];
    }
  }
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(image(box), corners, options_.points, kCornerQuality, distance, mask);
  for (cv::Point2f& p : corners) p += cv::Point2f(box.tl());
  return corners;
}

MaskKeeper::Followed MaskKeeper::follow(const Kept& kept, const cv::Mat& gray) const {
  Followed result;
  if (pyramid_.empty()) return result;
  std::vector<cv::Point2f> from = corners_of(kept, pyramid_.front(), {}, shrink_, kCornerDistance), to;
  std::vector<std::uint8_t> found;
  const auto take = [&](int shrink, cv::Point origin) {
    const auto f = static_cast<float>(shrink);
    const cv::Point2f middle(0.5F * (f - 1.0F) + static_cast<float>(origin.x),
                             0.5F * (f - 1.0F) + static_cast<float>(origin.y));
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (found[i] == 0) continue;
      result.from.push_back(f * from[i] + middle);
      result.to.push_back(f * to[i] + middle);
    }
  };
  if (shrink_ == 1 || static_cast<int>(from.size()) >= options_.points / 2) {
    if (!from.empty())
      cv::calcOpticalFlowPyrLK(pyramid_, next_pyramid_, from, to, found, cv::noArray(), kFlowWindow,
                               kFlowLevels);
    take(shrink_, {});
    return result;
  }
  const cv::Rect around = grown(cv::boundingRect(kept.mask) + kept.at.tl(), kFineReach, gray.size());
  from = corners_of(kept, gray_(around), around.tl(), 1, kFineDistance);
  if (!from.empty())
    cv::calcOpticalFlowPyrLK(gray_(around), gray(around), from, to, found, cv::noArray(), kFineWindow,
                             kFineLevels);
  take(1, around.tl());
  return result;
}

bool MaskKeeper::carry(Kept& kept, const cv::Mat& gray, const cv::Mat& depth) const {
  const Followed corners = follow(kept, gray);
  if (static_cast<int>(corners.from.size()) < options_.min_points) return false;
  std::vector<float> du, dv;
  for (std::size_t i = 0; i < corners.from.size(); ++i) {
    du.push_back(corners.to[i].x - corners.from[i].x);
    dv.push_back(corners.to[i].y - corners.from[i].y);
  }
  const cv::Point2f shift(median_of(du), median_of(dv));
  std::vector<float> values;
  for (const cv::Point2f& p : corners.from) {
    const int u = cvRound(p.x + shift.x), v = cvRound(p.y + shift.y);
    if (u < 0 || v < 0 || u >= depth.cols || v >= depth.rows) continue;
    const float z = depth.at<float>(v, u);
    if (is_valid_depth(z) && (kept.depth == 0 || std::abs(z - kept.depth) < options_.depth_margin))
      values.push_back(z);
  }
  if (static_cast<int>(values.size()) < options_.min_points) return false;  // something else is there now
  const float now = median_of(values);

  // Of the image, what the mask and its reach may come to lie on.
  const cv::Rect there(kept.at.x + cvFloor(shift.x), kept.at.y + cvFloor(shift.y), kept.at.width,
                       kept.at.height);
  const cv::Rect box = grown(there, options_.band + 2, gray.size());
  if (box.empty()) return false;
  const cv::Point offset(whole(shift.x + static_cast<float>(kept.at.x - box.x)),
                         whole(shift.y + static_cast<float>(kept.at.y - box.y)));
  cv::Mat moved = placed(kept.mask, offset, box.size()), most = placed(kept.reach, offset, box.size()), reach;
  cv::dilate(moved, reach, square(options_.band));
  cv::bitwise_and(reach, most, reach);
  const float margin = options_.depth_margin;
  for (int v = 0; v < moved.rows; ++v) {
    auto* m = moved.ptr<std::uint8_t>(v);
    const auto* r = reach.ptr<std::uint8_t>(v);
    const auto* z = depth.ptr<float>(v + box.y) + box.x;
    for (int u = 0; u < moved.cols; ++u) {
      // Without branches, so that the loop is of vectors.
      const bool decides = (r[u] != 0) & is_valid_depth(z[u]);
      const std::uint8_t own = std::abs(z[u] - now) < margin ? 255 : 0, was = m[u];
      m[u] = decides ? own : was;
    }
  }
  if (cv::countNonZero(moved) < kSmallest) return false;
  const cv::Rect tight = cv::boundingRect(most);  // the mask is within
  kept.mask = moved(tight);
  kept.reach = most(tight);
  kept.at = tight + box.tl();
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
  shrink_ = std::max(1, cvRound(gray.cols / static_cast<double>(kFlowWidth)));
  Masks out;
  if (detected) out.labels = detected->labels.clone();
  if (out.labels.empty()) out.labels = cv::Mat::zeros(gray.size(), CV_8UC1);
  std::vector<Kept> next;
  cv::Mat seen = cv::Mat::zeros(gray.size(), CV_8UC1);
  if (detected) {
    for (Kept& part : parts_of(*detected)) {
      part.seen = t;
      refine(part, depth);
      if (cv::countNonZero(part.mask) < kSmallest) continue;
      seen(part.at) |= part.mask;
      cv::dilate(part.mask, part.reach, square(options_.most_band));
      next.push_back(std::move(part));
    }
  }
  const bool follows = !kept_.empty() || !next.empty();
  if (follows) {
    // Into the memory of the last but one, which is never the caller's image; a copy of the keeper may have
    // it.
    if (shared(next_pyramid_)) next_pyramid_.clear();
    cv::Mat image = gray;
    if (shrink_ > 1) {
      // Whole blocks of pixels, so that a pixel's place is known; less than a block at the far borders is
      // left out.
      const cv::Size size(gray.cols / shrink_, gray.rows / shrink_);
      cv::resize(gray({0, 0, size.width * shrink_, size.height * shrink_}), shrunk_, size, 0, 0,
                 cv::INTER_AREA);
      image = shrunk_;
    }
    cv::buildOpticalFlowPyramid(image, next_pyramid_, kFlowWindow, kFlowLevels, true, cv::BORDER_REFLECT_101,
                                cv::BORDER_CONSTANT, false);
  }
  cv::Mat all = seen.clone();
  int covered = cv::countNonZero(all);
  carried_ = 0;
  const double most_cover = options_.max_cover * static_cast<double>(gray.total());
  const auto found_again = [&](const Kept& k) {
    return cv::countNonZero(k.mask & seen(k.at)) > options_.redetected * cv::countNonZero(k.mask);
  };
  for (Kept& k : kept_) {
    if (found_again(k)) continue;
    if (outdated(k, t) || !carry(k, gray, depth) || found_again(k)) continue;
    const int more = cv::countNonZero(k.mask & ~all(k.at));
    if (covered + more > most_cover) continue;  // it cannot be right
    all(k.at) |= k.mask;
    covered += more;
    ++carried_;
    next.push_back(std::move(k));
  }
  kept_ = std::move(next);
  gray_ = gray;
  if (follows) std::swap(pyramid_, next_pyramid_);
  out.dynamic = all;
  // What moves never becomes furniture, nor the other way round.
  out.labels.setTo(static_cast<int>(Label::person), all);
  out.instances = cv::Mat::zeros(gray.size(), CV_16UC1);
  for (std::size_t i = 0; i < kept_.size(); ++i)
    out.instances(kept_[i].at).setTo(static_cast<double>(i + 1), kept_[i].mask);
  return out;
}

}  // namespace dynslam::runtime
