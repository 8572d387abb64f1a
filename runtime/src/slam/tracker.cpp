// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>

#include "dynslam/features/masked_features.hpp"
#include "dynslam/interop/opencv.hpp"
#include "io/argument_check.hpp"
#include "slam/input_check.hpp"
#include "slam/tracker_present.hpp"

namespace dynslam::runtime {
namespace {

MatchedPoseOptions<double> pose_options(const TrackerOptions& options) {
  MatchedPoseOptions<double> result = options.pose;
  result.depth_noise = options.depth_noise;
  return result;
}

PointMakerOptions<double> point_options(const TrackerOptions& options) {
  PointMakerOptions<double> result = options.points;
  result.depth_noise = options.depth_noise;
  result.average = !options.bundle;
  return result;
}

MotionSegmenterOptions<double> geometry_options(const TrackerOptions& options) {
  MotionSegmenterOptions<double> result = options.geometry;
  result.method = options.method;
  result.own_reference.use = false;  // keyframes serve
  result.pose_check.use = false;     // what moves was looked for before the pose is given
  return result;
}

}  // namespace

std::string_view to_string(TrackingState state) {
  constexpr std::array<std::string_view, 4> kNames{"not initialised", "tracked", "relocalised", "lost"};
  return kNames[static_cast<std::size_t>(state)];
}

Tracker::Tracker(const CameraConfig& camera, const TrackerOptions& options)
    : camera_(checked(camera)),
      options_(options),
      additions_(options.additions.value_or(additions(options.method, options.dynamics))),
      extractor_(options.features),
      matcher_(camera.model, camera.width, camera.height, extractor_.scales(), options.matching),
      pose_(camera.model.pinhole(), pose_options(options)),
      points_(camera.model.pinhole(), camera.width, camera.height, point_options(options)),
      geometry_(camera.model, geometry_options(options)),
      last_view_(options.alignment),
      bundle_(camera.model.pinhole(), options.local_bundle),
      verifier_(camera.model.pinhole(), camera.model, options.depth_noise, options.relocalisation),
      loops_(camera.model.pinhole(), camera.model, options.depth_noise, options.loops) {}

Tracker::~Tracker() = default;

TrackResult Tracker::track(const RgbdFrame& input, const std::optional<Masks>& prior) {
  check_input(input, prior, camera_, last_t_);
  last_t_ = input.t;
  Present now(input);
  extract(now);
  mask_a_priori(now, prior);
  now.done(Stage::features, input.preparation_ms);

  if (now.frame.index >= bundle_due_) finish();
  if (!initialised_) {
    start_map(now);
    now.done(Stage::keyframe);
    return now.finish();
  }

  now.result.state = TrackingState::tracked;
  bool located = locate_with_prior(now);
  if (located) look_behind(now);
  if (located && begin_again(now)) {
    located = locate(now);
    if (located) look_behind(now);
  }
  began_at_rest_ = false;
  if (!located) {
    now.plain = true;  // what keeps movers out must not lose the camera: without it, at last
    now.result.state = relocalise(now)                                          ? TrackingState::relocalised
                       : locate(now)                                            ? TrackingState::tracked
                       : (look_again() && locate(now))                          ? TrackingState::tracked
                       : locate_by_alignment(now, options_.search.weak_inliers) ? TrackingState::tracked
                                                                                : TrackingState::lost;
  }
  now.done(Stage::local_map);
  if (now.result.state == TrackingState::lost) {
    remember_lost(now);
    end_last_keyframe();
    ++lost_frames_;
    last_moving_.release();
    standing_.release();  // where somebody stood is known only as long as the camera's place is
    return now.finish();
  }

  if (uses_geometry(options_.dynamics)) {
    find_movers(now);
    pose_without_movers(now);
    doubt_points_on_movers(now);
  }
  revise_last(now);
  end_last_keyframe();
  accept(now);
  now.done(Stage::pose);
  const cv::Mat moves = moves_now(now.result);
  if (uses_geometry(options_.dynamics)) geometry_.remember(now.T_c_w, interop::view<const std::uint8_t>(moves));
  if (wants_keyframe(now)) keep(now);
  if (uses_geometry(options_.dynamics) && geometry_.reference_worn())
    set_reference(now.frame);
  now.result.T_w_c = now.frame.T_c_w.inverse();
  now.result.reference = map_.newest();
  now.result.T_c_reference = now.frame.T_c_w * map_.pose(map_.newest()).inverse();
  recover(now);
  remember_last(now, moves);
  now.done(Stage::keyframe);
  return now.finish();
}

void Tracker::extract(Present& now) {
  set_motion(now, velocity_);
  now.image = now.input.features;
  if (!now.image) {
    auto own = std::make_shared<ImageFeatures>();
    extractor_.extract(now.input.gray, *own);
    now.image = std::move(own);
  }
  const auto& keypoints = now.image->keypoints;
  Frame& frame = now.frame;
  frame.descriptors = now.image->descriptors;
  frame.index = frames_++;
  frame.t = now.input.t;
  frame.features.resize(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const cv::KeyPoint& k = keypoints[i];
    const float sigma = extractor_.scale(k.octave) *
                        matcher_.placer().stretch(Eigen::Vector2f(k.pt.x, k.pt.y).cast<double>());
    frame.features[i] = {.u = k.pt.x, .v = k.pt.y, .angle = k.angle, .octave = k.octave, .sigma = sigma};
  }
  matcher_.placer().place(std::span<Feature>(frame.features), now.depth);
  frame.point.assign(frame.features.size(), -1);
  frame.dynamic.assign(frame.features.size(), 0);
  frame.grid.build(frame.features, camera_.width, camera_.height);
  matcher_.begin(frame);
}

void Tracker::start_map(Present& now) {
  const auto enough = [&] {
    return unmasked_with_depth(now.frame.features, now.frame.dynamic) >= options_.initial_features;
  };
  if (now.covers_view) disbelieve_prior(now, MaskVerdict::covers_view);
  if (!enough() && !(disbelieve_prior(now, MaskVerdict::starved) && enough())) return;
  if (uses_geometry(options_.dynamics))  // for its images: nothing is there yet to compare them with
    geometry_.segment(interop::view<const std::uint8_t>(now.input.gray), now.depth, now.input.t,
                      SE3<double>());
  keep(now);
  initialised_ = true;
  first_ = now.frame.index;
  began_at_rest_ = camera_.readout_time != 0;
  now.result.state = TrackingState::tracked;
  now.result.inliers = last_keyframe_tracked_;
  if (uses_geometry(options_.dynamics))
    geometry_.remember(now.frame.T_c_w,
                       interop::view<const std::uint8_t>(std::as_const(now.result.dynamic_mask)));
  remember_last(now, now.result.dynamic_mask);
}

/// Forgets what was matched and how the camera was found to move.
void Tracker::start_again(Present& now) {
  matcher_.clear(now.frame);
  set_motion(now, velocity_);
  now.turn.setZero();
  place_features(now);
}

SE3<double> Tracker::predicted_pose() const {
  return SE3<double>::exp(velocity_.log() * (lost_frames_ + 1)) * last_.T_c_w;
}

bool Tracker::locate(Present& now) {
  return locate_by_features(now) || (!now.plain && locate_by_alignment(now, options_.search.weak_inliers));
}

bool Tracker::locate_by_features(Present& now) {
  const PoseSearchOptions& o = options_.search;
  if (lost_frames_ >= o.coasting_frames) return false;
  const SE3<double> predicted = predicted_pose();
  // The best of the weak starts is taken, the one by the last frame's grey values among them.
  std::optional<Attempt> best;
  for (const float radius : {o.near_radius, o.far_radius}) {
    if (!try_initial_pose(now, predicted, radius)) continue;
    if (now.result.inliers >= o.min_inliers) {
      now.done(Stage::initial_pose);
      const bool poor = now.result.inliers < o.sure_inliers;
      if (!(poor ? settle_on_local_map(now, o.min_inliers) : prove_on_local_map(now, o.min_inliers)))
        return false;
      if (!poor || !look_around(now)) measure_rows(now);
      return true;
    }
    const Attempt start = attempt(now);
    if (settle_on_local_map(now, 2 * o.min_inliers) && (!best || now.result.inliers > best->result.inliers))
      best = attempt(now);
    take_back(now, start);
  }
  now.done(Stage::initial_pose);
  if (!best) return false;
  const bool aligned = !now.plain && align_with_last(now) && settle_on_local_map(now, 2 * o.min_inliers) &&
                       now.result.inliers > best->result.inliers;
  if (!aligned) take_back(now, *best);
  if (!look_around(now) && aligned) measure_rows(now);
  return true;
}

Tracker::Attempt Tracker::attempt(const Present& now) const {
  return {now.frame, now.result, now.T_c_w, now.turn, matcher_.placer().rolling_shutter()};
}

void Tracker::take_back(Present& now, const Attempt& earlier) {
  now.frame = earlier.frame;
  now.result = earlier.result;
  now.T_c_w = earlier.T_c_w;
  now.turn = earlier.turn;
  matcher_.placer().set_depth_motion(depth_motion(now.input, now.T_c_w * last_.T_c_w.inverse()));
  matcher_.placer().set_rolling_shutter(earlier.shutter);
}

bool Tracker::try_initial_pose(Present& now, const SE3<double>& predicted, float radius) {
  const PoseSearchOptions& o = options_.search;
  pose_.set_rows_known();  // as predicted, until the local map tells
  if (matcher_.match_last(map_, last_, predicted, radius, now.frame) < o.weak_inliers) return false;
  matcher_.refine(map_, predicted, now.image->pyramid, now.depth, now.frame);
  pose_.gather(map_, now.frame);
  PoseConsensusOptions<double> consensus;
  consensus.seed = options_.seed + now.frame.index;
  const Eigen::Vector2i image_size(camera_.width, camera_.height);
  if (additions_.motion_prior && !now.plain) {
    const double interval = std::max(1e-3, now.input.t - last_.t);
    consensus.prior_share = o.prior_share;
    consensus.prior_translation = o.prior_speed * interval;
    consensus.prior_rotation = o.prior_turn * interval;
  }
  const SE3<double> start =
      pose_.consensus(predicted, std::span<const SE3<double>>(&last_.T_c_w, 1), consensus,
                      additions_.surface_weights && !now.plain ? &image_size : nullptr);
  pose_.keep_consistent(start, consensus.truncation, now.frame);
  const PoseResult<double> pose = pose_.optimize(map_, start, now.frame);
  if (pose.inliers < o.weak_inliers) return false;
  now.T_c_w = pose.T_c_w;
  now.result.inliers = pose.inliers;
  return true;
}

bool Tracker::align_with_last(Present& now) {
  if (!additions_.image_alignment || last_view_.empty() || lost_frames_ >= options_.search.coasting_frames)
    return false;
  if (!now.aligned) {
    const SE3<double> predicted = SE3<double>::exp(velocity_.log() * (lost_frames_ + 1));
    now.aligned = last_view_.align(now.image->pyramid, camera_.model, predicted);
  }
  if (!now.aligned->ok()) return false;
  const SE3<double> T_c_w = now.aligned->T_image_reference * last_.T_c_w;
  if (!reachable(T_c_w, now.frame.t)) return false;  // a mover fills the view
  now.plain = false;  // from a good start what moves can be told from what stands
  matcher_.clear(now.frame);
  now.T_c_w = T_c_w;
  return true;
}

bool Tracker::locate_by_alignment(Present& now, int wanted) {
  if (!align_with_last(now) || !settle_on_local_map(now, wanted)) return false;
  measure_rows(now);
  return true;
}

bool Tracker::prove_on_local_map(Present& now, int wanted) {
  place_again(now);
  matcher_.match_local(map_, now.T_c_w, now.image->pyramid, now.depth, now.frame);
  // Patches are found beside the corners that were flagged. Where a mask leaves next to nothing they would be
  // all that there is; elsewhere they may serve, few as they are.
  if (!now.left_out.empty()) flag(now.frame, now.left_out, now.frame.dynamic);
  if (now.covers_view && !now.semantic.empty()) flag(now.frame, now.semantic, now.frame.dynamic);
  if (additions_.strict_local_map && !now.plain) {
    // The pose is good to a fraction of a pixel already. What is farther off moves, and were it let in, a
    // robust kernel would give it its share.
    pose_.gather(map_, now.frame);
    pose_.keep_consistent(now.T_c_w, options_.search.local_chi2, now.frame);
  }
  look_for_turn(now, now.turn);
  const PoseResult<double> pose = pose_.optimize(map_, now.T_c_w, now.frame);
  now.T_c_w = pose.T_c_w;
  now.result.inliers = pose.inliers;
  now.result.covariance = pose.covariance;
  if (pose.inliers < wanted) return false;
  take_turn(now, pose.turn);
  return true;
}

bool Tracker::relocalise(Present& now) {
  pose_.set_rows_known();
  places_.query(now.frame, places_found_);
  if (places_found_.size() > static_cast<std::size_t>(options_.search.candidates))
    places_found_.resize(static_cast<std::size_t>(options_.search.candidates));
  // The place of last is worth a look even where the index does not name it.
  const int newest = map_.standing(map_.newest());
  if (std::none_of(places_found_.begin(), places_found_.end(),
                   [&](const auto& f) { return f.second == newest; }))
    places_found_.emplace_back(0, newest);
  for (const auto& [votes, keyframe] : places_found_) {
    matcher_.clear(now.frame);
    const auto found = verifier_.verify(map_, now.frame, now.depth, keyframe);
    if (!found.ok()) continue;
    for (const auto& [feature, point] : found.matches)
      now.frame.point[static_cast<std::size_t>(feature)] = point;
    matcher_.match_local(map_, found.T_c_w, now.image->pyramid, now.depth, now.frame);
    const PoseResult<double> result = pose_.optimize(map_, found.T_c_w, now.frame);
    if (result.inliers < 2 * options_.search.min_inliers || !reachable(result.T_c_w, now.frame.t)) continue;
    now.T_c_w = result.T_c_w;
    now.result.covariance = result.covariance;
    return true;
  }
  return false;
}

void Tracker::accept(Present& now) {
  Frame& frame = now.frame;
  frame.T_c_w = now.T_c_w;
  matcher_.drop_unmatched(frame);
  for (const int p : frame.point) now.result.matches += p >= 0 ? 1 : 0;
  usual_inliers_ =
      std::max(static_cast<double>(now.result.inliers), options_.search.usual_decay * usual_inliers_);
  velocity_interval_ = interval(now.input).value_or(0);
  velocity_ = lost_frames_ == 0 ? now.T_c_w * last_.T_c_w.inverse() : SE3<double>();
  lost_frames_ = 0;
}

}  // namespace dynslam::runtime
