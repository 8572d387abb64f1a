// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_truth.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>

namespace dynslam::runtime::bag {
namespace {

using Track = PoseTrack;

bool near(const SE3<double>& a, const SE3<double>& b) {
  constexpr double kSame = 1e-6;  // metres; of a quaternion
  const auto &p = a.so3().quaternion().coeffs(), &q = b.so3().quaternion().coeffs();
  return (a.translation() - b.translation()).cwiseAbs().maxCoeff() <= kSame &&
         std::min((p - q).cwiseAbs().maxCoeff(), (p + q).cwiseAbs().maxCoeff()) <= kSame;
}

bool stands_still(const Track& track) {
  return std::all_of(track.poses.begin(), track.poses.end(),
                     [&](const auto& pose) { return near(pose.second, track.poses.front().second); });
}

/// The transforms above a frame, the nearest first; why there is no such chain in `fault`.
std::vector<const Track*> chain_above(const BagSurvey& survey, const std::string& frame, std::string& fault) {
  std::multimap<std::string, const Track*> above;
  for (const Track& track : survey.tracks) {
    if (track.transforms) above.emplace(track.child, &track);
  }
  std::vector<const Track*> chain;
  std::set<std::string> seen{frame};
  for (std::string at = frame; above.contains(at); at = chain.back()->parent) {
    if (above.count(at) > 1) {
      fault = fmt::format("tf has two parents of {}", at);
      return {};
    }
    chain.push_back(above.find(at)->second);
    if (!seen.insert(chain.back()->parent).second) {
      fault = fmt::format("tf goes in a circle at {}", chain.back()->parent);
      return {};
    }
  }
  return chain;
}

/// Without those that come once more, as tf repeats them. @return false where two of one time differ
bool take_poses(const Track& track, const SE3<double>& before, const SE3<double>& behind,
                std::vector<StampedPose<double>>& poses) {
  for (std::size_t i = 0; i < track.poses.size(); ++i) {
    const auto& [time, pose] = track.poses[i];
    if (i > 0 && time == track.poses[i - 1].first) {
      if (!near(pose, track.poses[i - 1].second)) return false;
      continue;
    }
    constexpr double kNano = 1e-9;
    poses.push_back({static_cast<double>(time) * kNano, before * pose * behind});
  }
  return true;
}

BagTruth missing(std::string why) {
  BagTruth truth;
  truth.missing = std::move(why);
  return truth;
}

/// Empty `missing` and no poses: tf does not move the camera at all.
BagTruth truth_of_transforms(const BagSurvey& survey, const std::string& frame) {
  BagTruth truth;
  const auto chain = chain_above(survey, frame, truth.missing);
  const Track* moving = nullptr;
  SE3<double> before, behind;  // world -> parent of the moving one, its child -> camera
  for (const Track* track : chain) {
    if (!stands_still(*track)) {
      if (moving != nullptr)
        return missing(
            fmt::format("tf moves the camera's frame {} by more than one transform ({} -> {}, {} -> {})",
                        frame, track->parent, track->child, moving->parent, moving->child));
      moving = track;
    } else if (moving != nullptr) {
      before = track->poses.front().second * before;
    } else {
      behind = track->poses.front().second * behind;
    }
  }
  if (moving == nullptr) return truth;
  if (!take_poses(*moving, before, behind, truth.poses))
    return missing(fmt::format("tf has two poses {} -> {} of one time", moving->parent, moving->child));
  truth.source = fmt::format("{} ({} -> {})", moving->topic, chain.back()->parent, frame);
  return truth;
}

}  // namespace

BagTruth truth_of(const BagSurvey& survey, const std::string& camera_frame) {
  if (!survey.pose_fault.empty()) return missing(survey.pose_fault);
  BagTruth truth = truth_of_transforms(survey, camera_frame);
  if (!truth.poses.empty() || !truth.missing.empty()) return truth;
  const Track* only = nullptr;
  std::string topics;
  for (const Track& track : survey.tracks) {
    if (track.transforms) continue;
    topics += fmt::format("{}{}", topics.empty() ? "" : ", ", track.topic);
    only = topics == track.topic ? &track : nullptr;
  }
  if (topics.empty())
    return missing(survey.poses_left_out > 0
                       ? survey.first_left_out
                       : fmt::format("neither tf moves the camera's frame '{}' nor is there a topic of poses",
                                     camera_frame));
  if (only == nullptr) return missing(fmt::format("several topics may be it: {}", topics));
  if (!only->child.empty() && only->child != camera_frame)
    return missing(fmt::format("{} is about '{}', and tf does not say where on it the camera's frame '{}' is",
                               only->topic, only->child, camera_frame));
  if (!take_poses(*only, {}, {}, truth.poses))
    return missing(fmt::format("{} has two poses of one time", only->topic));
  truth.source = only->topic;
  return truth;
}

}  // namespace dynslam::runtime::bag
