// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/geometry/pose_curve.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/track/local_map_pose.hpp"

namespace dynslam {

/// A frame that was lost and found afterwards.
template <std::floating_point S>
struct FoundFrame {
  FrameTime time;
  PoseResult<S> pose;
};

/// Goes once more through a loss: once the camera is known on both sides of it, its frames are looked for
/// again.
/// @tparam C  the camera as recorded
/// @tparam P  of the images that are kept; it owns them
template <DifferentiableCamera C, ImagePyramidLike P>
  requires std::floating_point<typename C::ScalarType>
class LossRecovery {
 public:
  using S = typename C::ScalarType;
  using Vector6 = typename SE3<S>::Vector6;

  explicit LossRecovery(const PoseTrackingOptions<S>& options) : options_(options) {}

  /// Whether remember() keeps the frame at hand; where it does not the loss is given up, for it is too long,
  /// or nothing is known of the camera before.
  [[nodiscard]] bool keeps(const LastFrame<S>& last) const {
    return static_cast<std::size_t>(last.lost_frames()) < options_.recovered_frames && !last.empty();
  }
  /// Gives the loss up.
  void forget() { lost_.clear(); }
  /// Keeps the frame at hand, which was lost. Call it before LastFrame::lose().
  /// @param pyramid  with images of its own
  /// @param frame    with its extracted features alone
  template <DepthImage D>
  void remember(const LastFrame<S>& last, const FrameTime& time, P pyramid, const D& depth,
                FeatureFrame<S> frame) {
    if (lost_.empty()) {
      velocity_ = last.velocity();
      interval_ = last.velocity_interval();
    }
    Image<float> kept(depth.width(), depth.height());
    for (int v = 0; v < depth.height(); ++v) {
      for (int u = 0; u < depth.width(); ++u) kept(u, v) = static_cast<float>(depth(u, v));
    }
    lost_.push_back({time, std::move(pyramid), std::move(kept), std::move(frame), {}});
  }

  /// Looks for the frames of the loss that the frame at hand ends, and forgets them.
  /// @param last  the frame before the loss; its velocity is that to the frame at hand afterwards, where the
  /// last of
  ///              the loss is found
  /// @param now   the frame at hand, tracked
  /// @return those that were found, in their order
  template <class Map>
  std::vector<FoundFrame<S>> recover(Map& map, LastFrame<S>& last, const FeatureFrame<S>& now,
                                     LocalMapPose<C>& solver) {
    std::vector<FoundFrame<S>> found;
    if (lost_.empty()) return found;
    std::vector<std::pair<int, int>> sights;  // of the map's points: how often visible and found
    for (const auto& p : map.points()) sights.emplace_back(p.visible, p.found);
    std::vector<Lost> lost = std::exchange(lost_, {});
    // From the end, where the map has what came into view meanwhile; then each between its neighbours. What
    // is found leads to more.
    constexpr int kRounds = 2;
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t i = lost.size(); i-- > 0;) visit(map, lost, i, last, now, solver);
      for (std::size_t i = 0; i < lost.size(); ++i) visit(map, lost, i, last, now, solver);
    }
    for (const Lost& l : lost) {
      if (l.pose) found.push_back({l.time, *l.pose});
    }
    if (lost.back().pose)
      last.set_velocity(now.T_c_w * lost.back().pose->T_c_w.inverse(), now.t - lost.back().time.t);
    // Points that were hidden all along are no worse for having been looked for so often.
    for (std::size_t p = 0; p < sights.size(); ++p) {
      auto& point = map.point(static_cast<int>(p));
      point.visible = sights[p].first;
      point.found = sights[p].second;
    }
    return found;
  }

 private:
  struct Lost {
    FrameTime time;
    P pyramid;
    Image<float> depth;
    FeatureFrame<S> frame;
    std::optional<PoseResult<S>> pose;  // what was found since
  };

  /// Looks for one of the lost frames where the poses around it lead, those of the others as they are found.
  template <class Map>
  void visit(Map& map, std::vector<Lost>& lost, std::size_t index, const LastFrame<S>& last,
             const FeatureFrame<S>& now, LocalMapPose<C>& solver) {
    const auto i = static_cast<std::ptrdiff_t>(index), n = static_cast<std::ptrdiff_t>(lost.size());
    // Known poses; the first tells how the camera moved before.
    const auto known = [&](std::ptrdiff_t k) -> std::optional<TimedPose<S>> {
      const FeatureFrame<S>& before = last.frame();
      if (k == -1) return TimedPose<S>{before.t, before.T_c_w};
      if (k == n) return TimedPose<S>{now.t, now.T_c_w};
      if (k >= 0 && k < n && lost[static_cast<std::size_t>(k)].pose) {
        const Lost& other = lost[static_cast<std::size_t>(k)];
        return TimedPose<S>{other.time.t, other.pose->T_c_w};
      }
      if (k == -2 && interval_ > 0)
        return TimedPose<S>{before.t - interval_, velocity_.inverse() * before.T_c_w};
      return std::nullopt;
    };
    constexpr std::size_t kEachSide = 2;
    around_.clear();
    for (std::ptrdiff_t k = i - 1; k >= -2 && around_.size() < kEachSide; --k)
      if (const auto pose = known(k)) around_.push_back(*pose);
    const std::size_t before = around_.size();
    for (std::ptrdiff_t k = i + 1; k <= n && around_.size() < before + kEachSide; ++k)
      if (const auto pose = known(k)) around_.push_back(*pose);
    if (before > 1) std::swap(around_[1], around_[before]);  // the nearest of either side come first
    locate(map, last, solver, lost[index]);
  }

  /// Looks for a frame on the local map by around_: known poses, the nearest before it and the nearest after
  /// it first.
  template <class Map>
  void locate(Map& map, const LastFrame<S>& last, LocalMapPose<C>& solver, Lost& lost) const {
    const std::span<const TimedPose<S>> around(around_);
    const double t = lost.time.t;
    // In a jerk a line is far off. Over a long loss two poses that lie close together tell nothing of the
    // velocity, and the curve through them runs away.
    const std::array<SE3<S>, 2> expected{pose_between<S>(around, t), pose_between<S>(around.first(2), t)};
    place(last, solver, expected.front(), lost);
    solver.optimiser().set_rows_known();
    const S reach = options_.recovered_speed * static_cast<S>(std::min(t - around[0].t, around[1].t - t));
    const auto led_to = [&](const SE3<S>& T_c_w) {
      return std::any_of(expected.begin(), expected.end(), [&](const SE3<S>& there) {
        const SE3<S> beside = T_c_w * there.inverse();
        return beside.translation().norm() <= reach && beside.so3().log().norm() <= reach;
      });
    };
    std::optional<PoseResult<S>> best;
    const auto look_from = [&](const SE3<S>& start, bool near) {
      const PoseResult<S> pose = search(map, solver, start, near, lost);
      if (pose.inliers < options_.recovered_inliers || !led_to(pose.T_c_w)) return;
      if (!best || pose.inliers > best->inliers) best = pose;
    };
    if (lost.pose) look_from(lost.pose->T_c_w, true);
    for (const SE3<S>& there : expected) {
      if (!best || best->inliers < options_.sure_inliers) look_from(there, false);
    }
    lost.pose = std::move(best);
  }

  /// Places a frame's features by how the camera moves along around_: its rows, and the depth image.
  void place(const LastFrame<S>& last, LocalMapPose<C>& solver, const SE3<S>& expected, Lost& lost) const {
    constexpr double kStep = 1e-3;  // [s]
    const std::span<const TimedPose<S>> around(around_);
    const Vector6 speed =
        (pose_between<S>(around, lost.time.t + kStep) * expected.inverse()).log() / static_cast<S>(kStep);
    const double delay = lost.time.depth_delay;
    const bool delayed = delay != 0 && std::abs(delay) < options_.longest_delay;
    FeaturePlacer<C>& placer = solver.placer();
    placer.set_depth_motion(delayed ? std::optional(SE3<S>::exp(speed * static_cast<S>(delay)))
                                    : std::nullopt);
    placer.set_rolling_shutter(
        last.readout_time() == 0
            ? RollingShutter<S>()
            : RollingShutter<S>{speed * static_cast<S>(last.readout_time()), last.height()});
    solver.matcher().begin(lost.frame);
    placer.place(std::span<Feature>(lost.frame.features), lost.depth);
  }

  /// The pose that the local map gives a frame. @param near  the start is the pose to within pixels
  template <class Map>
  PoseResult<S> search(Map& map, LocalMapPose<C>& solver, const SE3<S>& start, bool near, Lost& lost) const {
    constexpr int kLooks = 4;
    FeatureFrame<S>& frame = lost.frame;
    MatchedPose<S>& optimiser = solver.optimiser();
    PoseResult<S> pose;
    pose.T_c_w = start;
    for (int look = 0, before = 0; look < (near ? 1 : kLooks); ++look, before = pose.inliers) {
      solver.matcher().match_local(map, pose.T_c_w, lost.pyramid, lost.depth, frame);
      optimiser.gather(map, frame);
      if (near || look > 0) optimiser.keep_consistent(pose.T_c_w, options_.local_chi2, frame);
      pose = optimiser.optimize(map, pose.T_c_w, frame);
      if (pose.inliers < options_.weak_inliers || (look > 0 && pose.inliers <= before)) break;
    }
    solver.matcher().clear(frame);
    return pose;
  }

  PoseTrackingOptions<S> options_;
  std::vector<Lost> lost_;  // since the camera was known, unless they are too many
  SE3<S> velocity_;         // of the camera before, and the time over which it was measured [s]
  double interval_ = 0;
  std::vector<TimedPose<S>> around_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
