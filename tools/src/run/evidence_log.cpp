// SPDX-License-Identifier: BSD-3-Clause
#include "run/evidence_log.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/error.hpp"
#include "io/base64.hpp"
#include "io/run_lengths.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kShared = 15;  // points in common that make keyframes neighbours, as LoopOptions has it

void set_bit(cv::Mat& values, const cv::Mat& mask, std::uint8_t bit) {
  if (mask.size() == values.size()) cv::bitwise_or(values, cv::Scalar(bit), values, mask);
}

std::string keypoints_of(const MotionResult<double>& motion) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(5 * motion.matches.size());
  const auto add = [&](double pixels) {
    const auto eighths = static_cast<std::uint16_t>(std::clamp(std::lround(8 * pixels), 0L, 65535L));
    bytes.push_back(static_cast<std::uint8_t>(eighths & 255U));
    bytes.push_back(static_cast<std::uint8_t>(eighths >> 8U));
  };
  for (const JudgedMatch<double>& m : motion.matches) {
    add(m.x_m.x());
    add(m.x_m.y());
    bytes.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(m.weight, 0.0, 1.0))));
  }
  return to_base64(bytes);
}

/// Names of files are bytes; JSON has text alone.
std::string line(const nlohmann::json& j) {
  return j.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

}  // namespace

EvidenceLog::EvidenceLog(const std::filesystem::path& file, const Sequence& sequence, cv::Size size)
    : file_(file), out_(file, std::ios::binary) {
  if (!out_) throw InputError(file_.string(), 0, "cannot be written");
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::absolute(sequence.root, error);
  out_ << line({{"report", 1},
                {"sequence", (error ? sequence.root : whole).string()},
                {"width", size.width},
                {"height", size.height}});
}

void EvidenceLog::add(const std::string& stamp, const TrackResult& result, const cv::Mat& semantic,
                      const MotionResult<double>* motion) {
  cv::Mat values = cv::Mat::zeros(result.dynamic_mask.size(), CV_8UC1);
  set_bit(values, semantic, kSemanticBit);
  if (motion != nullptr)
    set_bit(values,
            cv::Mat(motion->mask.height(), motion->mask.width(), CV_8UC1,
                    const_cast<std::uint8_t*>(motion->mask.data())),  // OpenCV has no read-only matrices
            kGeometricBit);
  set_bit(values, result.dynamic_mask, kFusedBit);
  nlohmann::json j{{"frame", stamp},
                   {"state", std::string(to_string(result.state))},
                   {"keyframe", result.keyframe},
                   {"matches", result.matches},
                   {"inliers", result.inliers},
                   {"masks", to_base64(encode_runs(values))}};
  if (motion != nullptr) j["keypoints"] = keypoints_of(*motion);
  out_ << line(j);
}

void EvidenceLog::finish(const LocalMap& map, std::span<const LoopClosing> loops) {
  nlohmann::json nodes = nlohmann::json::array(), edges = nodes, closed = nodes;
  std::vector<int> votes;
  for (const Keyframe& k : map.keyframes()) {
    if (k.culled()) continue;
    const Eigen::Vector3d p = map.pose(k.id).inverse().translation();
    nodes.push_back({k.id, k.frame.t, p.x(), p.y(), p.z()});
    votes.assign(map.keyframes().size(), 0);
    map.count_shared(k.frame.point, votes);
    for (int other = 0; other < k.id; ++other) {
      const int shared = votes[static_cast<std::size_t>(other)];
      if (shared >= kShared && !map.keyframe(other).culled()) edges.push_back({other, k.id, shared});
    }
  }
  for (const LoopClosing& loop : loops)
    closed.push_back({map.standing(loop.keyframe), map.standing(loop.seen_again), loop.inliers});
  out_ << line({{"keyframes", nodes}, {"edges", edges}, {"loops", closed}});
  out_.close();
  if (!out_) throw InputError(file_.string(), 0, "could not be written");
}

}  // namespace dynslam::runtime
