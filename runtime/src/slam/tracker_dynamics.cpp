// SPDX-License-Identifier: BSD-3-Clause
// What moves, or may move, and what of it the tracker believes.
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/dynamics/standing.hpp"
#include "dynslam/features/masked_features.hpp"
#include "dynslam/interop/opencv.hpp"
#include "slam/tracker_present.hpp"

namespace dynslam::runtime {
namespace {

/// Whether more than a share of the matches lies on a mask.
bool rests_on(const Frame& frame, const cv::Mat& mask, double share) {
  std::vector<std::uint8_t> on_mask;
  flag(frame, mask, on_mask);
  std::ptrdiff_t matches = 0, on_it = 0;
  for (std::size_t i = 0; i < on_mask.size(); ++i) {
    if (frame.point[i] < 0) continue;
    ++matches;
    on_it += on_mask[i] != 0 ? 1 : 0;
  }
  return static_cast<double>(on_it) > share * static_cast<double>(matches);
}

}  // namespace

void Tracker::mask_a_priori(Present& now, const std::optional<Masks>& prior) const {
  if (!uses_semantic(options_.dynamics) || !prior || prior->dynamic.empty()) {
    now.result.dynamic_mask = cv::Mat::zeros(now.input.gray.size(), CV_8UC1);
    return;
  }
  now.prior = &*prior;
  now.semantic = widened(prior->dynamic, options_.semantic_dilation);
  flag(now.frame, now.semantic, now.frame.dynamic);
  // The margin keeps features off a mover's rim; the mask that is handed on is the object itself.
  cv::compare(prior->dynamic, 0, now.result.dynamic_mask, cv::CMP_NE);
  now.covers_view = unmasked_share<double>(now.frame.dynamic) < options_.arbitration.min_left;
  if (now.covers_view || standing_.empty()) return;
  now.semantic.setTo(0, standing_);  // of the frame before: people hardly jump in one
  std::fill(now.frame.dynamic.begin(), now.frame.dynamic.end(), 0);
  flag(now.frame, now.semantic, now.frame.dynamic);
}

/// Goes on without the a-priori mask, as far as the pose is concerned. @return whether there was one
bool Tracker::disbelieve_prior(Present& now, MaskVerdict why) {
  if (now.semantic.empty()) return false;
  now.semantic.release();
  std::fill(now.frame.dynamic.begin(), now.frame.dynamic.end(), 0);
  now.result.mask_rejected = why;
  return true;
}

/// A mask that leaves little is wrong, or somebody stands right before the camera. What it leaves and all
/// that there is are asked where the camera is, then. The mask goes where it leaves no pose, or hides much
/// that moves as the rest does; and where what it leaves has led farther from where the camera was going.
bool Tracker::locate_with_prior(Present& now) {
  const PoseSearchOptions& o = options_.search;
  const bool solid = locate(now);
  if (now.semantic.empty() || (solid && !now.covers_view)) return solid;
  bool by_rest = solid;
  if (!solid) {
    start_again(now);
    by_rest = locate_by_alignment(now, o.weak_inliers);
  }
  const Attempt rest = attempt(now);
  const cv::Mat semantic = now.semantic;
  disbelieve_prior(now, now.covers_view ? MaskVerdict::covers_view : MaskVerdict::starved);
  start_again(now);
  const bool by_all = locate(now);
  if (!by_rest || (by_all && leads_farther(rest, attempt(now), solid ? 2 : 1))) return by_all;
  take_back(now, rest);
  now.semantic = semantic;
  return true;
}

/// Whether a pose agrees with a far more certain one, or is `times` as far from the predicted pose.
bool Tracker::leads_farther(const Attempt& rest, const Attempt& all, double times) const {
  const auto pose = [](const Attempt& found) {
    PoseResult<double> p;
    p.T_c_w = found.T_c_w;
    p.covariance = found.result.covariance;
    p.inliers = found.result.inliers;
    p.status = PoseStatus::converged;
    return p;
  };
  MaskArbitrationOptions<double> options = options_.arbitration;
  options.min_inliers = options_.search.weak_inliers;
  if (arbitrate_mask(pose(rest), pose(all), options) != MaskVerdict::kept) return true;
  const SE3<double> T_predicted_w = predicted_pose();
  const auto off = [&](const Attempt& found) { return (found.T_c_w * T_predicted_w.inverse()).log().norm(); };
  return off(rest) > times * off(all);
}

/// In the first frames nothing was seen to move yet, and a mover that has most of the features passes for the
/// room. But the room is what lies behind. Where that moves in another way than the pose says, by its grey
/// values and by its features, the pose goes with a mover, and what lies behind has its own way. A pose that
/// hardly rests on what stands before does not go with it, and is not asked.
void Tracker::look_behind(Present& now) {
  if (!additions_.image_alignment || !uses_geometry(options_.dynamics) || last_view_.empty() ||
      lost_frames_ > 0 || now.frame.index - first_ > options_.search.young_frames)
    return;
  cv::Mat foreground = cv::Mat::zeros(now.input.gray.size(), CV_8UC1);
  if (!geometry_.mark_foreground(now.depth, interop::view<std::uint8_t>(foreground)) ||
      !rests_on(now.frame, foreground, options_.search.foreground_share))
    return;
  const auto behind = last_view_.align_behind(now.image->pyramid, now.depth, foreground, camera_.model,
                                              now.T_c_w * last_.T_c_w.inverse());
  if (!behind.ok()) return;
  const Attempt before = attempt(now);
  matcher_.clear(now.frame);
  std::vector<std::uint8_t> flags = now.frame.dynamic;
  now.left_out = widened(foreground, options_.feature_margin);
  now.T_c_w = behind.T_image_reference * last_.T_c_w;
  const bool proven = prove_on_local_map(now, options_.search.min_inliers);
  now.left_out.release();
  pose_.gather(map_, now.frame);
  const double outlier = options_.search.local_chi2;
  if (proven && pose_.mean_chi2(before.T_c_w, outlier) > outlier / 2) {  // most of what lies behind is not there
    flags.resize(now.frame.features.size(), 0);
    for (std::size_t i = 0; i < flags.size(); ++i) {
      if (now.frame.dynamic[i] != flags[i]) now.frame.point[i] = -1;
    }
    now.frame.dynamic = std::move(flags);
    now.foreground = foreground;
    return;
  }
  take_back(now, before);
}

void Tracker::find_movers(Present& now) {
  TrackResult& result = now.result;
  if (geometry_.has_reference()) geometry_.place_reference(T_reference_keyframe_ * map_.pose(reference_id_));
  const SE3<double> T_c_last = now.T_c_w * last_.T_c_w.inverse();
  geometry_.set_depth_motion(depth_motion(now.input, T_c_last));
  geometry_.set_rolling_shutter(matcher_.placer().rolling_shutter());
  // What has most of the keypoints would be the measure of what is static.
  cv::Mat suspected = now.semantic;
  if (!now.foreground.empty()) suspected = suspected.empty() ? now.foreground : suspected | now.foreground;
  constexpr std::array kStages{Stage::lucas_kanade, Stage::residuals, Stage::free_space, Stage::growing};
  Stopwatch watch;
  const auto& motion = geometry_.segment(
      interop::view<const std::uint8_t>(now.input.gray), now.depth, now.input.t, now.T_c_w,
      interop::view<const std::uint8_t>(std::as_const(suspected)),
      [&](MotionStage s) { result.times[kStages[static_cast<std::size_t>(s)]] = watch.lap_ms(); });
  const auto wrapped = [&](const Image<std::uint8_t>& mask) {  // OpenCV has no read-only matrices
    return cv::Mat(now.input.gray.size(), CV_8UC1, const_cast<std::uint8_t*>(mask.data()));
  };
  now.moving = wrapped(motion.mask);
  now.moving_widened =
      cv::countNonZero(now.moving) > 0 ? widened(now.moving, options_.feature_margin) : now.moving;
  if (now.prior != nullptr && options_.method == Method::full) find_standing(now);
  now.watch.lap_ms();
}

/// Finds surfaces that are static: where they were long before. It is used for the pose whatever an a-priori mask says of it, and stays in
/// the mask that is output, as something that may move.
void Tracker::find_standing(Present& now) {
  constexpr int kStride = 4;  // [px]
  standing_.create(now.result.dynamic_mask.size(), CV_8UC1);
  standing_.setTo(0);
  mark_standing(
      interop::view<const std::uint8_t>(std::as_const(now.moving_widened)),
      [&](int u, int v) { return geometry_.verified_static(static_cast<float>(u), static_cast<float>(v)); }, kStride,
      interop::view<std::uint8_t>(standing_));
  now.result.dynamic_mask.setTo(kMayMove, standing_ & now.result.dynamic_mask);
}

/// Optimises the pose again on what the fused mask leaves (paper, step 10), or what is left by that part of
/// it which can be believed.
void Tracker::pose_without_movers(Present& now) {
  Frame& frame = now.frame;
  // A feature is a patch: at the rim of a mover half of it moves.
  std::vector<std::vector<std::uint8_t>> masks(now.semantic.empty() ? 1 : 2);
  for (auto& mask : masks) flag(frame, now.moving_widened, mask);
  for (auto& mask : masks) mask.resize(frame.features.size(), 0);
  if (!now.semantic.empty()) {
    cv::Mat suspected = widened(now.result.dynamic_mask, options_.feature_margin);
    if (!standing_.empty()) suspected.setTo(0, standing_);
    flag(frame, suspected, masks[0]);
    for (std::size_t i = 0; i < frame.dynamic.size(); ++i) masks[0][i] |= frame.dynamic[i];
  }
  look_for_turn(now, now.turn);
  const auto fused = masked_pose(
      pose_, map_, now.T_c_w, masks, options_.arbitration, frame,
      [&](int point) { ++map_.point(point).on_mover; }, masked_pose_);
  if (fused.verdict != MaskVerdict::kept) now.result.mask_rejected = fused.verdict;
  if (fused.pose.inliers >= options_.search.min_inliers) {
    now.T_c_w = fused.pose.T_c_w;
    now.result.inliers = fused.pose.inliers;
    now.result.covariance = fused.pose.covariance;
    take_turn(now, fused.pose.turn);
  }
  // That matches on a mask are used for the pose does not mean that what it shows is static.
  cv::bitwise_or(now.result.dynamic_mask, now.moving, now.result.dynamic_mask);
  if (fused.mask < masks.size()) return;
  for (std::size_t i = 0; i < frame.dynamic.size(); ++i) {  // what nothing speaks for makes no points
    const Feature& f = frame.features[i];
    frame.dynamic[i] = masks[0][i] != 0 && frame.point[i] < 0 && !geometry_.verified_static(f.u, f.v) ? 1 : 0;
  }
}

/// What a mover showed before it was known to move is in the map, and there it stays where it was: the
/// camera, once lost, would be found beside it when it is back. No wall can be where a mover is or in front
/// of it: a point that is expected there, and is not seen, went with it.
void Tracker::doubt_points_on_movers(Present& now) {
  if (!additions_.doubted_points || cv::countNonZero(now.moving) == 0) return;
  const auto moving = interop::view<const std::uint8_t>(std::as_const(now.moving));
  matcher_.unmatched_in_view(map_, now.T_c_w, now.frame, [&](int id, const auto& pixel, double z) {
    const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
    if (!moving.contains(u, v) || moving(u, v) == 0) return;
    const double there = static_cast<double>(now.depth(u, v));
    if (is_valid_depth(there) && z <= there * (1 + options_.behind_mover)) ++map_.point(id).on_mover;
  });
}

}  // namespace dynslam::runtime
