// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <span>
#include <string>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/slam/track_result.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Bits of a pixel in a frame's recorded masks.
inline constexpr std::uint8_t kSemanticBit = 1, kGeometricBit = 2, kFusedBit = 4;

/// What a report shows of a run beside its other files: report.jsonl, a line of JSON for each frame.
///
/// First line: {"report": 1, "sequence": folder, "width", "height"}. A frame: {"frame": stamp, "state",
/// "keyframe", "matches", "inliers", "masks", "keypoints"}: masks as encode_runs() in base64, bits as above;
/// keypoints of the geometry in base64, five bytes each: u and v of 1/8 pixel as 16-bit numbers, the lower
/// byte first, and the static weight (Eq 7) of 1/255, at most 1. Last line: {"keyframes": [[id, t, x, y, z]],
/// "edges": [[id, id, points in common]], "loops": [[id, id, inliers]]}.
class EvidenceLog {
 public:
  /// @throws InputError
  EvidenceLog(const std::filesystem::path& file, const Sequence& sequence, cv::Size size);

  /// @param semantic  the a-priori mask; empty: none
  /// @param motion    what the geometry found; null: nothing was asked of it
  void add(const std::string& stamp, const TrackResult& result, const cv::Mat& semantic,
           const MotionResult<double>* motion);
  /// @throws InputError where any of it could not be written
  void finish(const LocalMap& map, std::span<const LoopClosing> loops);

 private:
  std::filesystem::path file_;
  std::ofstream out_;
};

}  // namespace dynslam::runtime
