// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/feature_extractor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <span>
#include <vector>
#include "io/argument_check.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kHalfPatch = 15;  // ORB's orientation and descriptor patch is 31 x 31
constexpr int kBorder = 19;     // the rotated descriptor pattern reaches this far

/// What the pixels around a keypoint weigh in the moments of its patch: per row below the middle one, so many
/// bytes from kHalfPatch + 1 pixels to the left on; 0 outside the circle.
struct CentroidWeights {
  static constexpr std::size_t kWidth = 2 * (kHalfPatch + 1);
  struct Row {
    std::array<std::int16_t, kWidth> x, y;
  };
  std::array<Row, kHalfPatch + 1> rows{};

  CentroidWeights() {
    for (int y = 0; y <= kHalfPatch; ++y) {
      const int half = static_cast<int>(std::lround(std::sqrt(kHalfPatch * kHalfPatch - y * y)));
      Row& row = rows[static_cast<std::size_t>(y)];
      for (int x = -half; x <= half; ++x) {
        const auto at = static_cast<std::size_t>(x + kHalfPatch + 1);
        row.x[at] = static_cast<std::int16_t>(x);
        row.y[at] = static_cast<std::int16_t>(y);
      }
    }
  }
};

/// Angle of the intensity centroid in degrees, [0, 360) (Rublee et al. 2011).
float centroid_angle(const cv::Mat& image, int u, int v) {
  static const CentroidWeights weights;
  int m01 = 0, m10 = 0;
  const auto step = static_cast<std::ptrdiff_t>(image.step1());
  const std::uint8_t* first = image.ptr<std::uint8_t>(v) + u - (kHalfPatch + 1);
  for (std::size_t x = 0; x < CentroidWeights::kWidth; ++x) m10 += weights.rows[0].x[x] * first[x];
  for (int y = 1; y <= kHalfPatch; ++y) {
    const CentroidWeights::Row& row = weights.rows[static_cast<std::size_t>(y)];
    const std::uint8_t* below = first + y * step;
    const std::uint8_t* above = first - y * step;
    for (std::size_t x = 0; x < CentroidWeights::kWidth; ++x) {
      m10 += row.x[x] * static_cast<std::int16_t>(below[x] + above[x]);
      m01 += row.y[x] * static_cast<std::int16_t>(below[x] - above[x]);
    }
  }
  return cv::fastAtan2(static_cast<float>(m01), static_cast<float>(m10));
}

/// Corners of a cell in the order of their numbers: strongest first; ties by position, so that the order does
/// not depend on the sort.
std::uint64_t rank_of(const FastCorner& corner) {
  return std::uint64_t{255U - static_cast<unsigned>(corner.score)} << 56U |
         std::uint64_t{static_cast<unsigned>(corner.v)} << 28U | static_cast<unsigned>(corner.u);
}
cv::KeyPoint keypoint_of(std::uint64_t rank) {
  constexpr unsigned kSide = (1U << 28U) - 1;
  constexpr float kDiameter = 7;  // of FAST's ring [px]
  return {static_cast<float>(rank & kSide), static_cast<float>(rank >> 28U & kSide), kDiameter, -1,
          static_cast<float>(255U - static_cast<unsigned>(rank >> 56U))};
}

/// Shares features out among the levels of a pyramid, in proportion to their scales; levels that are too
/// small get none. So the coarsest corners are as coarse a part of the image at every size.
/// @param side  smaller side of the image [px]
std::vector<int> features_per_level(std::span<const float> scales, int features, int side) {
  constexpr float kSmallest = 120;  // pixels of the smaller side; of 8 levels of 640x480 the last has 134
  std::size_t used = 1;
  while (used < scales.size() && static_cast<float>(side) / scales[used] >= kSmallest) ++used;
  float total = 0.0F;
  for (const float s : scales.first(used)) total += 1.0F / s;
  std::vector<int> wanted(scales.size(), 0);
  for (std::size_t level = 0; level < used; ++level)
    wanted[level] =
        std::max(1, static_cast<int>(std::lround(static_cast<float>(features) / scales[level] / total)));
  return wanted;
}

}  // namespace

FeatureExtractor::FeatureExtractor(const FeatureOptions& options) : options_(options) {
  check_argument(
      options.features >= 1 && options.levels >= 1 && options.levels <= 32 && options.scale_factor > 1 &&
          options.scale_factor <= 4 && options.cell >= 1,
      "FeatureExtractor: expected features, levels (to 32) and cell of 1 or more, a scale factor above 1 to "
      "4");
  float scale = 1.0F;
  for (int level = 0; level < options_.levels; ++level) {
    scales_.push_back(scale);
    scale *= options_.scale_factor;
  }
  // It sees each of our levels as an image of its own: from the whole image it would make all of them once
  // more.
  orb_ = cv::ORB::create(options_.features, options_.scale_factor, 1, kBorder, 0, 2, cv::ORB::FAST_SCORE,
                         2 * kHalfPatch + 1, options_.fast_threshold);
}

void FeatureExtractor::detect_level(const cv::Mat& image, int wanted) {
  const int width = image.cols - 2 * kBorder, height = image.rows - 2 * kBorder;
  if (width < options_.cell || height < options_.cell) return;
  const int columns = std::max(1, width / options_.cell), rows = std::max(1, height / options_.cell);
  const float cell_w = static_cast<float>(width) / static_cast<float>(columns);
  const float cell_h = static_cast<float>(height) / static_cast<float>(rows);

  cells_.resize(static_cast<std::size_t>(columns * rows));
  for (auto& cell : cells_) cell.clear();
  const cv::Rect inner(kBorder, kBorder, width, height);
  fast_.find(image, inner, std::clamp(options_.fast_threshold, 0, 255), corners_);
  for (const FastCorner& k : corners_) {
    const int c = std::clamp(static_cast<int>(static_cast<float>(k.u - inner.x) / cell_w), 0, columns - 1);
    const int r = std::clamp(static_cast<int>(static_cast<float>(k.v - inner.y) / cell_h), 0, rows - 1);
    cells_[static_cast<std::size_t>(r * columns + c)].push_back(rank_of(k));
  }
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      auto& cell = cells_[static_cast<std::size_t>(r * columns + c)];
      if (!cell.empty()) continue;
      const int x0 = inner.x + static_cast<int>(static_cast<float>(c) * cell_w);
      const int y0 = inner.y + static_cast<int>(static_cast<float>(r) * cell_h);
      const int x1 = inner.x + static_cast<int>(static_cast<float>(c + 1) * cell_w);
      const int y1 = inner.y + static_cast<int>(static_cast<float>(r + 1) * cell_h);
      fast_.find(image, cv::Rect(x0, y0, x1 - x0, y1 - y0), std::clamp(options_.fast_threshold_low, 0, 255),
                 corners_);
      for (const FastCorner& k : corners_) cell.push_back(rank_of(k));
    }
  }

  // Water-filling: the largest per-cell share whose total does not exceed what is wanted.
  std::size_t share = 0;
  for (std::size_t trial = 1; trial <= 64; ++trial) {
    std::size_t total = 0;
    for (const auto& cell : cells_) total += std::min(cell.size(), trial);
    if (total > static_cast<std::size_t>(wanted) && share > 0) break;
    share = trial;
  }
  for (auto& cell : cells_) {
    const auto taken = cell.begin() + static_cast<std::ptrdiff_t>(std::min(cell.size(), share));
    std::partial_sort(cell.begin(), taken, cell.end());
    for (auto at = cell.begin(); at != taken; ++at) {
      cv::KeyPoint& k = level_keypoints_.emplace_back(keypoint_of(*at));
      k.angle = centroid_angle(image, static_cast<int>(k.pt.x), static_cast<int>(k.pt.y));
    }
  }
}

void FeatureExtractor::describe_level(int level, ImageFeatures& out) {
  if (level_keypoints_.empty()) return;
  // May drop keypoints at the border.
  orb_->compute(out.pyramid.levels[static_cast<std::size_t>(level)], level_keypoints_, level_descriptors_);
  const float size = static_cast<float>(2 * kHalfPatch + 1) * scales_[static_cast<std::size_t>(level)];
  for (std::size_t i = 0; i < level_keypoints_.size(); ++i) {
    cv::KeyPoint k = level_keypoints_[i];
    const Eigen::Vector2d base = out.pyramid.to_base(Eigen::Vector2d(k.pt.x, k.pt.y), level);
    k.pt = cv::Point2f(static_cast<float>(base.x()), static_cast<float>(base.y()));
    k.octave = level;
    k.size = size;
    out.keypoints.push_back(k);
    std::memcpy(out.descriptors.emplace_back().data(),
                level_descriptors_.ptr<std::uint8_t>(static_cast<int>(i)), sizeof(Descriptor));
  }
}

void FeatureExtractor::extract(const cv::Mat& image, ImageFeatures& out) {
  check_image(image, {}, CV_8UC1, "FeatureExtractor::extract(): the image");
  // OpenCV's ORB blurs over the border of a part of a larger image, whose surroundings are none of our
  // business.
  const cv::Mat gray = image.isSubmatrix() ? image.clone() : image;
  out.keypoints.clear();
  out.descriptors.clear();
  out.pyramid.levels.resize(static_cast<std::size_t>(options_.levels));
  out.pyramid.pixel_size.resize(static_cast<std::size_t>(options_.levels));
  const std::vector<int> wanted =
      features_per_level(scales_, options_.features, std::min(gray.cols, gray.rows));
  for (int level = 0; level < options_.levels; ++level) {
    cv::Mat& reduced = out.pyramid.levels[static_cast<std::size_t>(level)];
    if (level == 0) {
      reduced = gray;
    } else {
      const float s = 1.0F / scales_[static_cast<std::size_t>(level)];
      const cv::Size size(cvRound(static_cast<float>(gray.cols) * s),
                          cvRound(static_cast<float>(gray.rows) * s));
      cv::resize(out.pyramid.levels[static_cast<std::size_t>(level) - 1], reduced, size, 0, 0,
                 cv::INTER_LINEAR);
    }
    out.pyramid.pixel_size[static_cast<std::size_t>(level)] = {static_cast<double>(gray.cols) / reduced.cols,
                                                               static_cast<double>(gray.rows) / reduced.rows};
    level_keypoints_.clear();
    if (wanted[static_cast<std::size_t>(level)] > 0)
      detect_level(reduced, wanted[static_cast<std::size_t>(level)]);
    describe_level(level, out);
  }
}

}  // namespace dynslam::runtime
