// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <istream>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace dynslam::runtime {

/// A keypoint of the geometry.
struct EvidenceKeypoint {
  float u, v;           ///< [px]
  std::uint8_t weight;  ///< static weight of 1/255
};

/// What a run noted of a frame, see EvidenceLog.
struct FrameEvidence {
  std::string state;
  bool keyframe = false;
  int matches = 0, inliers = 0;
  std::vector<std::uint8_t> masks;  ///< runs
  bool judged = false;              ///< the geometry was asked
  std::vector<EvidenceKeypoint> keypoints;
};

struct GraphNode {
  int id = 0;
  double t = 0;                 ///< [s]
  std::array<double, 3> p_w{};  ///< [m]
};
struct GraphEdge {
  int a = 0, b = 0, points = 0;  ///< ids of keyframes; points in common, or that prove a loop
};

struct Evidence {
  std::filesystem::path sequence;
  cv::Size size;
  std::map<std::string, FrameEvidence> frames;  ///< by stamp
  std::vector<GraphNode> keyframes;
  std::vector<GraphEdge> edges, loops;
  /// The masks of a frame as bits; empty where it has none.
  [[nodiscard]] cv::Mat masks(const std::string& stamp) const;
};

/// 255 where a pixel's value has a bit, CV_8UC1.
[[nodiscard]] cv::Mat pixels_with(const cv::Mat& values, std::uint8_t bit);

/// Reads report.jsonl. @throws InputError with the line
[[nodiscard]] Evidence parse_evidence(std::istream& in, const std::string& name);
[[nodiscard]] Evidence read_evidence(const std::filesystem::path& file);

}  // namespace dynslam::runtime
