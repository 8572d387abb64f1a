// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <span>
#include <vector>

#include "dynslam/runtime/slam/fast_corners.hpp"
#include "dynslam/runtime/slam/image_pyramid.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// How many features, and of what kind.
struct FeatureOptions {
  int features = 1000;         ///< wanted per image
  int levels = 8;              ///< pyramid levels
  float scale_factor = 1.2F;   ///< between levels
  int fast_threshold = 20;     ///< first FAST threshold (grey values)
  int fast_threshold_low = 7;  ///< second one, for cells where the first finds nothing
  int cell = 32;               ///< side of a distribution cell in pixels of its level
};

/// What is found in an image, and the image at the scales where it was found.
struct ImageFeatures {
  std::vector<cv::KeyPoint> keypoints;  ///< level-0 pixels, octave, angle
  std::vector<Descriptor> descriptors;
  ImagePyramid pyramid;  ///< level 0 shares the image's memory, unless it is a part of a larger one
};

/// FAST corners spread over the image by cells, with OpenCV's ORB descriptors.
///
/// OpenCV's own ORB keeps the strongest corners wherever they are, which starves weakly textured
/// parts of the view; here each cell of each level gets its share first (as ORB-SLAM2 does with a
/// quadtree) and cells without a strong corner are searched again with a lower threshold.
class FeatureExtractor {
 public:
  explicit FeatureExtractor(const FeatureOptions& options);

  /// Fills keypoints, one descriptor each, and the pyramid; the order is by octave, then by row-major
  /// cell, so it depends on the image alone.
  void extract(const cv::Mat& image, ImageFeatures& out);

  /// Scale of pyramid level `octave` against level 0.
  [[nodiscard]] float scale(int octave) const { return scales_[static_cast<std::size_t>(octave)]; }
  /// Of all levels.
  [[nodiscard]] std::span<const float> scales() const { return scales_; }
  [[nodiscard]] int levels() const { return options_.levels; }
  [[nodiscard]] float scale_factor() const { return options_.scale_factor; }

 private:
  // Into level_keypoints_, with pixels of the level.
  void detect_level(const cv::Mat& image, int wanted);
  // level_keypoints_ with their descriptors, to out.
  void describe_level(int level, ImageFeatures& out);

  FeatureOptions options_;
  std::vector<float> scales_;
  cv::Ptr<cv::ORB> orb_;
  FastCorners fast_;
  std::vector<FastCorner> corners_;
  std::vector<std::vector<std::uint64_t>> cells_;  // corners, the smaller the stronger
  std::vector<cv::KeyPoint> level_keypoints_;
  cv::Mat level_descriptors_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
