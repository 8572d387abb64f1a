// SPDX-License-Identifier: BSD-3-Clause
// What the tracker does with the map: keyframes, loops, and the adjustment that runs beside it.
#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/map/covering_keyframe.hpp"
#include "dynslam/map/keyframe_policy.hpp"
#include "io/argument_check.hpp"
#include "slam/tracker_present.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::size_t kBadPoints = 1000;  // beside as many as live ones: half a megabyte

}  // namespace

bool Tracker::wants_keyframe(const Present& now) const {
  KeyframeEvidence<double> seen;
  seen.frames = static_cast<int>(now.frame.index - last_keyframe_index_);
  if (last_keyframe_t_) seen.frames = frames_of_30_hz(seen.frames, now.frame.t - *last_keyframe_t_);
  seen.inliers = now.result.inliers;
  seen.points_then = last_keyframe_tracked_;
  seen.T_c_keyframe = now.frame.T_c_w * map_.pose(map_.newest()).inverse();
  return dynslam::wants_keyframe(seen, options_.keyframes);
}

void Tracker::keep(Present& now) {
  Frame& frame = now.frame;
  frame.T_c_w = frame.T_c_w * settle();  // the bundle adjustment writes the map, and so does what follows
  if (map_.points().size() > kBadPoints + 2 * static_cast<std::size_t>(live_points(map_))) {
    const std::vector<int> ids = map_.drop_bad_points();
    for (int& p : frame.point) p = p >= 0 ? ids[static_cast<std::size_t>(p)] : -1;
  }
  const int known = covering_keyframe(map_, frame, options_.coverage, votes_);
  if (known < 0) {
    insert_keyframe(now);
  } else {  // that one serves, and the octree alone gets anything of this frame
    (void)map_.add_seen_again(frame, known);
    map_.cull();
    last_keyframe_tracked_ = now.result.matches;
  }
  last_keyframe_index_ = frame.index;
  last_keyframe_t_ = frame.t;
  if (uses_geometry(options_.dynamics) &&
      (!geometry_.has_reference() || map_.newest() - reference_id_ > options_.reference_distance))
    set_reference(frame);
  now.result.keyframe = true;
}

void Tracker::insert_keyframe(Present& now) {
  Frame& frame = now.frame;
  if (initialised_) {
    points_.trust_all(frame);
    // Where a mask was rejected a mover may be on what it covered.
    const bool doubtful = options_.method == Method::full && now.result.mask_rejected != MaskVerdict::kept;
    if ((additions_.proven_points || doubtful) && uses_geometry(options_.dynamics))
      points_.trust(frame, [&](float u, float v) { return geometry_.verified_static(u, v); });
    last_keyframe_tracked_ = points_.make(map_, now.image->pyramid, frame);
  } else {
    last_keyframe_tracked_ = make_first_points(now.image->pyramid, frame);
  }
  frame.grid.build(frame.features, camera_.width, camera_.height);
  const int id = map_.add_keyframe(frame);
  map_.cull();
  std::optional<LoopClosing>& loop = now.result.loop;
  if (options_.close_loops) loop = loops_.close(map_, places_, id, now.depth);
  if (loop) {
    follow(loop->D);
    frame.T_c_w = map_.keyframe(id).frame.T_c_w;
    frame.point = map_.keyframe(id).frame.point;
  }
  places_.add(id, map_.keyframe(id).frame);
  inserted_ = id;
  if (options_.bundle && id > 0) {
    wanted_bundle_ = loop ? options_.loop_bundle_window : 0;
    bundle_due_ =
        frame.index + static_cast<std::size_t>(loop ? options_.loop_bundle_delay : options_.bundle_delay);
  }
}

/// Makes the points of the first keyframe. Of nothing it is known yet whether it moves: what an a-priori mask
/// suspects makes points, too, which serve once it has stood still for a while.
/// @return number of features with a point outside the mask
int Tracker::make_first_points(const ImagePyramid& pyramid, Frame& frame) {
  const std::vector<std::uint8_t> suspected = frame.dynamic;
  if (options_.method == Method::full && uses_geometry(options_.dynamics))
    std::fill(frame.dynamic.begin(), frame.dynamic.end(), 0);
  points_.trust_all(frame);
  points_.make(map_, pyramid, frame);
  frame.dynamic = suspected;
  int tracked = 0;
  for (std::size_t i = 0; i < frame.point.size(); ++i)
    tracked += frame.point[i] >= 0 && frame.dynamic[i] == 0 ? 1 : 0;
  return tracked;
}

void Tracker::remember_last(Present& now, const cv::Mat& moves) {
  last_ = std::move(now.frame);
  last_shutter_ = matcher_.placer().rolling_shutter();
  last_ns_ = now.input.ns;
  last_reference_ = map_.newest();
  now.moving.copyTo(last_moving_);
  if (additions_.image_alignment)
    last_view_.remember(now.image->pyramid, now.depth, moves, last_moving_);
  if (!additions_.second_look && !began_at_rest_) return;
  const std::vector<cv::Mat>& levels = now.image->pyramid.levels;
  cv::Mat own = last_pyramid_.levels.empty() ? cv::Mat() : last_pyramid_.levels.front();
  levels.front().copyTo(own);  // level 0 may be the caller's
  last_pyramid_ = now.image->pyramid;
  last_pyramid_.levels.front() = own;
}

bool Tracker::look_again() {
  if (!additions_.second_look || lost_frames_ > 0 || last_pyramid_.levels.empty()) return false;
  (void)settle();  // the bundle adjustment writes the map
  std::fill(last_.dynamic.begin(), last_.dynamic.end(), 0);
  if (!last_moving_.empty()) flag(last_, widened(last_moving_, options_.feature_margin), last_.dynamic);
  points_.trust_all(last_);
  insert_last(points_.make(map_, last_pyramid_, last_));
  return true;
}

/// The first frame was placed as a camera at rest would have seen it. The second tells how it moved: the map
/// begins anew, the rows where they belong. @return whether it did
bool Tracker::begin_again(const Present& now) {
  if (!began_at_rest_ || !interval(now.input)) return false;
  velocity_ = now.T_c_w * last_.T_c_w.inverse();
  matcher_.placer().set_rolling_shutter(shutter(now.input, velocity_));
  for (Feature& f : last_.features) matcher_.placer().bring_to_middle(f);
  std::fill(last_.point.begin(), last_.point.end(), -1);
  map_ = LocalMap();
  places_ = PlaceIndex();
  insert_last(make_first_points(last_pyramid_, last_));
  if (!uses_geometry(options_.dynamics)) return true;
  geometry_.set_rolling_shutter(shutter(now.input, velocity_));  // its images are still the last frame's
  set_reference(last_);
  return true;
}

/// Makes the last frame a keyframe, with the points that were made for `tracked` of its features.
void Tracker::insert_last(int tracked) {
  last_keyframe_tracked_ = tracked;
  last_.grid.build(last_.features, camera_.width, camera_.height);
  const int id = map_.add_keyframe(last_);
  places_.add(id, last_);
  last_keyframe_index_ = last_.index;
  last_keyframe_t_ = last_.t;
  last_pyramid_ = {};  // once
}

void Tracker::set_reference(const Frame& frame) {
  std::vector<ReferenceKeypoint<double>> keypoints;
  keypoints.reserve(frame.features.size());
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    const Feature& f = frame.features[i];
    keypoints.push_back({Eigen::Vector2d(f.u, f.v), matcher_.placer().depth_of_row(f),
                         static_cast<double>(extractor_.scale(f.octave)),
                         frame.dynamic[i] != 0});
  }
  geometry_.set_reference(keypoints, frame.T_c_w);
  reference_id_ = map_.newest();
  T_reference_keyframe_ = frame.T_c_w * map_.pose(reference_id_).inverse();
}

void Tracker::finish() {
  (void)settle();
}

void Tracker::load(LocalMap map) {
  check_argument(!initialised_ && frames_ == 0, "Tracker::load() comes before the first frame");
  check_argument(!map.keyframes().empty(), "Tracker::load(): the map has no keyframe");
  map_ = std::move(map);
  for (const Keyframe& k : map_.keyframes()) {
    if (!k.culled()) places_.add(k.id, k.frame);
  }
  initialised_ = true;
  lost_frames_ = 1;
}

int Tracker::adopt(const LocalMap& other, const SE3<double>& T_w_other) {
  finish();  // the adjustment's thread knows keyframes by their address
  const int first = map_.append(other, T_w_other);
  for (int id = first; id <= map_.newest(); ++id) {
    if (!map_.keyframe(id).culled()) places_.add(id, map_.keyframe(id).frame);
  }
  return first;
}

/// The keyframe that the last frame became, if it did, is as it stays: what waited for that begins.
void Tracker::end_last_keyframe() {
  inserted_.reset();
  start_bundle();
}

void Tracker::start_bundle() {
  if (!wanted_bundle_) return;
  bundle_.start(map_, options_.depth_noise, *wanted_bundle_);
  wanted_bundle_.reset();
}

SE3<double> Tracker::settle() {
  start_bundle();
  if (!bundle_.pending()) return {};
  const SE3<double> D = bundle_.apply(map_);
  ++adjustments_;
  follow(D);
  for (const int id :
       map_.cull_keyframes(map_.newest(), options_.redundant_keyframe, options_.spare_keyframes))
    places_.remove(id);
  return D;
}

void Tracker::follow(const SE3<double>& D) {
  last_.T_c_w = last_.T_c_w * D;
  geometry_.follow(D);
}

}  // namespace dynslam::runtime
