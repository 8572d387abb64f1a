// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/stopwatch.hpp"
#include "slam/input_check.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kMatchFar = 100;  // Hamming distance accepted where the geometry already limits the search
constexpr std::size_t kInitialFeatures = 100;  // with depth, to start a map
constexpr float kNowhere = -1e6F;              // ideal pixel of those for which the lens has no inverse

double& time_of(StageTimes& times, Stage stage) {
  return times[static_cast<std::size_t>(stage)];
}

}  // namespace

std::optional<DynamicsMode> parse_dynamics(std::string_view name) {
  for (const auto mode :
       {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both}) {
    if (name == to_string(mode)) return mode;
  }
  return std::nullopt;
}

std::string_view to_string(DynamicsMode mode) {
  switch (mode) {
    case DynamicsMode::none:
      return "none";
    case DynamicsMode::semantic:
      return "semantic";
    case DynamicsMode::geometric:
      return "geometric";
    case DynamicsMode::both:
      return "both";
  }
  return "unknown";
}

std::string_view to_string(TrackingState state) {
  switch (state) {
    case TrackingState::not_initialised:
      return "not initialised";
    case TrackingState::tracked:
      return "tracked";
    case TrackingState::relocalised:
      return "relocalised";
    case TrackingState::lost:
      return "lost";
  }
  return "unknown";
}

Tracker::Tracker(const CameraConfig& camera, const TrackerOptions& options)
    : camera_(camera),
      options_(options),
      extractor_(options.features),
      geometry_(camera, options.geometry),
      bundle_(camera.model.pinhole(), options.local_bundle),
      verifier_(camera.model.pinhole(), camera.model, options.depth_noise, options.relocalisation),
      loops_(camera.model.pinhole(), camera.model, options.depth_noise, options.loops) {
  undistort_lut_.resize(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height));
  for (int v = 0; v < camera_.height; ++v) {
    for (int u = 0; u < camera_.width; ++u) {
      const auto ideal = camera_.model.undistort_pixel(Eigen::Vector2d(u, v));
      // Where the distortion has no inverse the pixel carries no geometry: it is put outside the image.
      undistort_lut_[static_cast<std::size_t>(v * camera_.width + u)] =
          ideal ? cv::Point2f(static_cast<float>(ideal->x()), static_cast<float>(ideal->y()))
                : cv::Point2f(kNowhere, kNowhere);
    }
  }
}

Eigen::Vector3d Tracker::point_of(const Frame& frame, int feature) const {
  const Feature& f = frame.features[static_cast<std::size_t>(feature)];
  const Eigen::Vector3d p_c =
      camera_.model.pinhole().ray(Eigen::Vector2d(f.x, f.y)) * static_cast<double>(f.depth);
  return frame.T_c_w.inverse() * p_c;
}

void Tracker::place(Feature& f, const Eigen::Vector2d& x, const cv::Mat& depth) const {
  f.u = static_cast<float>(x.x());
  f.v = static_cast<float>(x.y());
  const int u = cvRound(f.u), v = cvRound(f.v);
  // The distortion is smooth: its displacement at the nearest pixel serves the sub-pixel position.
  const cv::Point2f ideal = undistort_lut_[static_cast<std::size_t>(v * camera_.width + u)];
  f.x = ideal.x + (f.u - static_cast<float>(u));
  f.y = ideal.y + (f.v - static_cast<float>(v));
  f.depth = 0;
  if (ideal.x == kNowhere) return;  // without a ray a depth is no point
  const float z = depth.at<float>(v, u);
  f.depth = is_valid_depth(z) ? z : 0.0F;
  if (!depth_moved_ || f.depth == 0) return;
  // The depth image was taken a little earlier or later: look where the point was then, and bring what
  // is measured there back.
  const Eigen::Vector3d p_c = camera_.model.pinhole().ray(Eigen::Vector2d(f.x, f.y)) * static_cast<double>(z);
  const Eigen::Vector3d p_d = T_depth_c_ * p_c;
  const auto x_d = camera_.model.project(p_d);
  f.depth = 0;
  if (!x_d) return;
  const int ud = static_cast<int>(std::lround(x_d->x())), vd = static_cast<int>(std::lround(x_d->y()));
  if (ud < 0 || vd < 0 || ud >= camera_.width || vd >= camera_.height) return;
  const float then = depth.at<float>(vd, ud);
  if (!is_valid_depth(then)) return;
  f.depth = static_cast<float>(static_cast<double>(then) + p_c.z() - p_d.z());
}

void Tracker::predict_depth_motion(const RgbdFrame& input) {
  constexpr double kLongest = 0.05;  // seconds over which the velocity is trusted
  const double interval = input.t - last_.t;
  depth_moved_ = initialised_ && lost_frames_ == 0 && input.depth_delay != 0 &&
                 std::abs(input.depth_delay) < kLongest && interval > 0 && interval < 4 * kLongest;
  if (depth_moved_) T_depth_c_ = SE3<double>::exp(velocity_.log() * (input.depth_delay / interval));
}

void Tracker::extract(const RgbdFrame& input, Frame& frame) {
  features_ = input.features;
  if (!features_) {
    auto own = std::make_shared<ImageFeatures>();
    extractor_.extract(input.gray, *own);
    features_ = std::move(own);
  }
  const auto& keypoints = features_->keypoints;
  frame.descriptors = features_->descriptors;
  frame.index = frames_++;
  frame.t = input.t;
  frame.features.resize(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const cv::KeyPoint& k = keypoints[i];
    Feature& f = frame.features[i];
    f.octave = k.octave;
    f.angle = k.angle;
    f.sigma = extractor_.scale(k.octave);
    place(f, Eigen::Vector2d(k.pt.x, k.pt.y), input.depth);
  }
  frame.point.assign(frame.features.size(), -1);
  frame.dynamic.assign(frame.features.size(), 0);
  frame.grid.build(frame.features, camera_.width, camera_.height);
  corners_ = frame.features.size();
}

void Tracker::drop_unmatched(Frame& frame) const {
  // Features that stand for a point only, without a corner of their own, mean nothing once it is lost.
  std::size_t kept = corners_;
  for (std::size_t i = corners_; i < frame.features.size(); ++i) {
    if (frame.point[i] < 0) continue;
    frame.features[kept] = frame.features[i];
    frame.descriptors[kept] = frame.descriptors[i];
    frame.point[kept] = frame.point[i];
    frame.dynamic[kept] = frame.dynamic[i];
    ++kept;
  }
  frame.features.resize(kept);
  frame.descriptors.resize(kept);
  frame.point.resize(kept);
  frame.dynamic.resize(kept);
}

void Tracker::flag_dynamic(Frame& frame, const cv::Mat& mask) const {
  if (mask.empty()) return;
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    const Feature& f = frame.features[i];
    if (mask.at<std::uint8_t>(cvRound(f.v), cvRound(f.u)) != 0) frame.dynamic[i] = 1;
  }
}

bool Tracker::initialise(Frame& frame, const RgbdFrame& input) {
  std::size_t usable = 0;
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    if (frame.dynamic[i] == 0 && frame.features[i].depth > 0) ++usable;
  }
  if (usable < kInitialFeatures) return false;
  frame.T_c_w = SE3<double>();
  insert_keyframe(frame, input);
  initialised_ = true;
  return true;
}

bool Tracker::find_best(const Frame& frame, const Descriptor& descriptor, float x, float y, float radius,
                        int octave_low, int octave_high, int max_distance, float ratio, int& best,
                        int& distance) const {
  const GuidedMatch match =
      guided_match(frame.view(), descriptor, {x, y, radius, octave_low, octave_high, max_distance, ratio});
  best = match.feature;
  distance = match.distance;
  return match.ok();
}

int Tracker::match_last(Frame& frame, const SE3<double>& T_c_w, float radius) {
  const auto& pinhole = camera_.model.pinhole();
  std::fill(frame.point.begin(), frame.point.end(), -1);
  drop_unmatched(frame);
  match_distance_.assign(frame.features.size(), 257);
  int matches = 0;
  for (std::size_t i = 0; i < last_.features.size(); ++i) {
    const int id = map_.present(last_.point[i]);
    if (id < 0 || last_.dynamic[i] != 0) continue;
    const MapPoint& p = map_.point(id);
    const auto x = pinhole.project(T_c_w * p.p_w);
    if (!x) continue;
    const Feature& f = last_.features[i];
    int best = -1, distance = 0;
    if (!find_best(frame, last_.descriptors[i], static_cast<float>(x->x()), static_cast<float>(x->y()),
                   radius * extractor_.scale(f.octave), f.octave - 1, f.octave + 1, kMatchFar, 0.9F, best,
                   distance)) {
      continue;
    }
    const auto b = static_cast<std::size_t>(best);
    if (distance >= match_distance_[b]) continue;
    if (frame.point[b] < 0) ++matches;
    frame.point[b] = id;
    match_distance_[b] = distance;
  }
  return matches;
}

void Tracker::move(Feature& f, const PatchMatch& match, const cv::Mat& depth) const {
  f.octave = match.level;
  f.sigma = static_cast<float>(options_.patch_sigma) * extractor_.scale(match.level);
  place(f, match.x, depth);
}

void Tracker::refine_matches(Frame& frame, const SE3<double>& T_c_w, const cv::Mat& depth) const {
  PatchMatch match;
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    if (frame.point[i] < 0) continue;
    Feature& f = frame.features[i];
    if (align(map_.points()[static_cast<std::size_t>(frame.point[i])], T_c_w, Eigen::Vector2d(f.u, f.v),
              match))
      move(f, match, depth);
  }
}

void Tracker::keep_consistent(Frame& frame, const SE3<double>& T_c_w, double bound) {
  for (std::size_t k = 0; k < observations_.size(); ++k) {
    if (observation_chi2(camera_.model.pinhole(), T_c_w, observations_[k]) >= bound)
      frame.point[static_cast<std::size_t>(observation_feature_[k])] = -1;
  }
}

bool Tracker::align(const MapPoint& p, const SE3<double>& T_c_w, const Eigen::Vector2d& start,
                    PatchMatch& out) const {
  if (p.patch.level < 0) return false;
  const SE3<double> T_ref_w = map_.pose(p.patch.keyframe);
  const Eigen::Matrix3d R = (T_c_w.so3() * T_ref_w.so3().inverse()).matrix();
  const auto warp = patch_warp(camera_.model.pinhole(), p.patch, T_c_w * p.p_w, R);
  return warp && PatchMatcher::match(features_->pyramid, p.patch, *warp, start, out);
}

int Tracker::match_local(Frame& frame, const SE3<double>& T_c_w, const cv::Mat& depth) {
  const auto& pinhole = camera_.model.pinhole();
  const Eigen::Vector3d centre = T_c_w.inverse().translation();
  map_.local_points(frame, options_.local_keyframes, candidates_);
  match_distance_.assign(frame.features.size(), 257);
  holder_.resize(map_.points().size());
  std::fill(holder_.begin(), holder_.end(), -1);
  for (std::size_t i = 0; i < frame.point.size(); ++i) {
    if (frame.point[i] < 0) continue;
    MapPoint& p = map_.point(frame.point[i]);
    holder_[static_cast<std::size_t>(frame.point[i])] = static_cast<int>(i);
    match_distance_[i] = -1;  // matched already: not to be replaced
    ++p.visible;
    ++p.found;
  }
  int matches = 0;
  const float log_factor = std::log(extractor_.scale_factor());
  for (const int id : candidates_) {
    const int held = holder_[static_cast<std::size_t>(id)];
    MapPoint& p = map_.point(id);
    const Eigen::Vector3d p_c = T_c_w * p.p_w;
    const auto x = pinhole.project(p_c);
    if (!x || x->x() < 0 || x->y() < 0 || x->x() >= camera_.width || x->y() >= camera_.height) continue;
    const Eigen::Vector3d ray = p.p_w - centre;
    const double distance_m = ray.norm();
    const double cosine = ray.dot(p.viewing) / (distance_m * std::max(1e-9, p.viewing.norm()));
    if (cosine < 0.5) continue;
    if (held < 0) ++p.visible;

    // Its patch says where it is to a fraction of a pixel.
    PatchMatch match;
    const auto expected = camera_.model.project(p_c);
    if (expected && align(p, T_c_w, *expected, match)) {
      Feature f;
      move(f, match, depth);
      if (f.x < 0 || f.y < 0 || f.x >= static_cast<float>(camera_.width) ||
          f.y >= static_cast<float>(camera_.height))
        continue;
      if (held >= 0) {
        Feature& own = frame.features[static_cast<std::size_t>(held)];
        f.angle = own.angle;
        own = f;
        continue;
      }
      // A corner that was found right there is the same thing; without one the point stands by itself.
      int best = -1, distance = 0;
      if (find_best(frame, p.descriptor, f.x, f.y, 2.0F * extractor_.scale(match.level), match.level - 2,
                    match.level + 2, kMatchFar, 1.0F, best, distance) &&
          frame.point[static_cast<std::size_t>(best)] < 0) {
        f.angle = frame.features[static_cast<std::size_t>(best)].angle;
        frame.features[static_cast<std::size_t>(best)] = f;
        frame.point[static_cast<std::size_t>(best)] = id;
        match_distance_[static_cast<std::size_t>(best)] = -1;
      } else {
        frame.features.push_back(f);
        frame.descriptors.push_back(p.descriptor);
        frame.point.push_back(id);
        frame.dynamic.push_back(0);
        match_distance_.push_back(-1);
      }
      ++p.found;
      ++matches;
      continue;
    }
    if (held >= 0) continue;

    const float ratio = p.reference_distance / static_cast<float>(distance_m);
    const int octave =
        std::clamp(p.reference_octave + static_cast<int>(std::lround(std::log(ratio) / log_factor)), 0,
                   extractor_.levels() - 1);
    int best = -1, distance = 0;
    const float radius = (cosine > 0.998 ? 2.5F : 4.0F) * 1.5F * extractor_.scale(octave);
    if (!find_best(frame, p.descriptor, static_cast<float>(x->x()), static_cast<float>(x->y()), radius,
                   octave - 1, octave + 1, kMatchFar, 0.8F, best, distance)) {
      continue;
    }
    const auto b = static_cast<std::size_t>(best);
    if (distance >= match_distance_[b]) continue;
    if (frame.point[b] < 0) {
      ++matches;
    } else {
      --map_.point(frame.point[b]).found;
    }
    frame.point[b] = id;
    match_distance_[b] = distance;
    ++p.found;
  }
  return matches;
}

void Tracker::gather(const Frame& frame) {
  observations_.clear();
  observation_feature_.clear();
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    if (frame.point[i] < 0 || frame.dynamic[i] != 0) continue;
    observations_.push_back(observe(frame.features[i], map_.point(frame.point[i]).p_w, options_.depth_noise));
    observation_feature_.push_back(static_cast<int>(i));
  }
}

PoseResult<double> Tracker::optimise(Frame& frame, const SE3<double>& start, bool drop_outliers) {
  gather(frame);
  PoseOptions<double> options;
  options.min_pixel_scale = options_.min_pixel_scale;
  const TDistribution<double> kernel{options_.nu};
  PoseResult<double> result =
      optimize_pose(camera_.model.pinhole(), std::span<const PoseObservation<double>>(observations_), start,
                    options, kernel, workspace_);
  if (drop_outliers) {
    for (std::size_t k = 0; k < observations_.size(); ++k) {
      if (workspace_.inlier[k] == 0) frame.point[static_cast<std::size_t>(observation_feature_[k])] = -1;
    }
  }
  return result;
}

void Tracker::weigh_by_surface(const SE3<double>& T_c_w) {
  SurfaceOptions<double> options;
  options.width = camera_.width;
  options.height = camera_.height;
  surface_weights<double>(T_c_w, observations_, options, weights_);
}

bool Tracker::reachable(const SE3<double>& T_c_w, double t) const {
  if (last_.features.empty()) return true;  // a map was loaded: the camera may be anywhere in it
  const SE3<double> step = T_c_w * last_.T_c_w.inverse();
  const double interval = t - last_.t;
  return step.translation().norm() <= options_.max_speed * interval &&
         step.so3().log().norm() <= options_.max_turn * interval;
}

bool Tracker::relocalise(Frame& frame, const cv::Mat& depth, SE3<double>& T_c_w) {
  places_.query(frame, places_found_);
  if (places_found_.size() > static_cast<std::size_t>(options_.relocalisation_candidates))
    places_found_.resize(static_cast<std::size_t>(options_.relocalisation_candidates));
  // The place of last is worth a look even where the index does not name it.
  const int newest = map_.newest();
  if (std::none_of(places_found_.begin(), places_found_.end(),
                   [&](const auto& f) { return f.second == newest; }))
    places_found_.emplace_back(0, newest);
  for (const auto& [votes, keyframe] : places_found_) {
    std::fill(frame.point.begin(), frame.point.end(), -1);
    drop_unmatched(frame);
    const auto found = verifier_.verify(map_, frame, interop::view<float>(depth), keyframe);
    if (!found.ok()) continue;
    for (const auto& [feature, point] : found.matches) frame.point[static_cast<std::size_t>(feature)] = point;
    match_local(frame, found.T_c_w, depth);
    const PoseResult<double> result = optimise(frame, found.T_c_w, true);
    if (result.inliers < 2 * options_.min_inliers || !reachable(result.T_c_w, frame.t)) continue;
    T_c_w = result.T_c_w;
    return true;
  }
  return false;
}

void Tracker::give_back_resting(const Masks& prior, const cv::Mat& depth, const cv::Mat& moving,
                                cv::Mat& dynamic) {
  constexpr int kStride = 4;
  constexpr int kEnough = 40;  // samples with depth
  resting_.create(dynamic.size(), CV_8UC1);
  resting_.setTo(0);
  if (prior.instances.empty()) return;
  struct Count {
    int seen = 0, still = 0, moving = 0;
  };
  std::vector<Count> counts;
  for (int v = 0; v < dynamic.rows; v += kStride) {
    for (int u = 0; u < dynamic.cols; u += kStride) {
      const std::size_t id = prior.instances.at<std::uint16_t>(v, u);
      if (id == 0 || prior.dynamic.at<std::uint8_t>(v, u) == 0 || !is_valid_depth(depth.at<float>(v, u)))
        continue;
      if (counts.size() <= id) counts.resize(id + 1);
      ++counts[id].seen;
      counts[id].still += geometry_.verified_static(static_cast<float>(u), static_cast<float>(v)) ? 1 : 0;
      counts[id].moving += moving.at<std::uint8_t>(v, u) != 0 ? 1 : 0;
    }
  }
  for (std::size_t id = 1; id < counts.size(); ++id) {
    const Count& c = counts[id];
    if (c.seen < kEnough || c.still < options_.resting_share * c.seen || 20 * c.moving > c.seen) continue;
    resting_.setTo(255, prior.instances == static_cast<double>(id));
  }
  dynamic.setTo(0, resting_);
}

void Tracker::finish() {
  (void)settle();
}

void Tracker::load(LocalMap map) {
  map_ = std::move(map);
  for (const Keyframe& k : map_.keyframes()) {
    if (!k.culled()) places_.add(k.id, k.frame);
  }
  initialised_ = true;
  lost_frames_ = 1;
}

SE3<double> Tracker::settle() {
  if (!bundle_.pending()) return {};
  const SE3<double> D = bundle_.apply(map_);
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

TrackResult Tracker::track(const RgbdFrame& input, const std::optional<Masks>& prior) {
  check_input(input, prior, camera_, last_t_);
  last_t_ = input.t;
  TrackResult result;
  Stopwatch whole, watch;
  Frame frame;
  predict_depth_motion(input);
  extract(input, frame);
  cv::Mat semantic;
  if (uses_semantic(options_.dynamics) && prior && !prior->dynamic.empty()) {
    const int size = 2 * options_.semantic_dilation + 1;
    cv::dilate(prior->dynamic, semantic, cv::getStructuringElement(cv::MORPH_RECT, {size, size}));
    if (!resting_.empty()) semantic.setTo(0, resting_);  // of the frame before: people hardly jump in one
    flag_dynamic(frame, semantic);
  }
  // The margin keeps features off a mover's rim; the mask that is handed on is the object itself.
  result.dynamic_mask =
      semantic.empty() ? cv::Mat::zeros(input.gray.size(), CV_8UC1) : prior->dynamic.clone();
  time_of(result.times, Stage::features) = watch.lap_ms() + input.preparation_ms;

  if (bundle_.pending() && frame.index >= bundle_due_) finish();
  if (!initialised_) {
    if (initialise(frame, input)) {
      result.state = TrackingState::tracked;
      result.keyframe = true;
      result.inliers = last_keyframe_tracked_;
      if (uses_geometry(options_.dynamics))
        geometry_.remember(input.depth, frame.T_c_w, result.dynamic_mask, false);
      last_ = std::move(frame);
    }
    time_of(result.times, Stage::keyframe) = watch.lap_ms();
    time_of(result.times, Stage::tracking) = whole.lap_ms();
    return result;
  }

  // Initial pose: points outside the a-priori mask, first near where the last frame's points are
  // expected, then the local map's.
  bool ok = false;
  int wanted = 2 * options_.min_inliers;  // inliers of the local map that a weak start needs, as a place does
  SE3<double> T_c_w;
  if (lost_frames_ < options_.coasting_frames) {
    const SE3<double> predicted = SE3<double>::exp(velocity_.log() * (lost_frames_ + 1)) * last_.T_c_w;
    for (const float radius : {12.0F, 30.0F}) {
      if (match_last(frame, predicted, radius) < options_.weak_inliers) continue;
      refine_matches(frame, predicted, input.depth);
      gather(frame);
      PoseConsensusOptions<double> consensus;
      consensus.seed = options_.seed + frame.index;
      weights_.clear();
      if (options_.dynamics != DynamicsMode::none) {  // which is the baseline: all features are equal
        weigh_by_surface(predicted);
        const double interval = std::max(1e-3, input.t - last_.t);
        consensus.prior_share = options_.prior_share;
        consensus.prior_translation = options_.prior_speed * interval;
        consensus.prior_rotation = options_.prior_turn * interval;
      }
      const SE3<double> start =
          pose_consensus<double>(camera_.model.pinhole(), observations_, predicted,
                                 std::span<const SE3<double>>(&last_.T_c_w, 1), consensus, weights_)
              .T_c_w;
      keep_consistent(frame, start, consensus.truncation);
      const PoseResult<double> pose = optimise(frame, start, true);
      if (pose.inliers < options_.weak_inliers) continue;
      T_c_w = pose.T_c_w;
      ok = true;
      if (pose.inliers < options_.min_inliers) continue;
      wanted = options_.min_inliers;
      break;
    }
  }
  time_of(result.times, Stage::initial_pose) = watch.lap_ms();
  if (ok) {
    match_local(frame, T_c_w, input.depth);
    if (uses_geometry(options_.dynamics)) {
      // The pose is good to a fraction of a pixel already. What is farther off moves, and were it let in, a
      // robust kernel would give it its share.
      gather(frame);
      keep_consistent(frame, T_c_w, options_.local_chi2);
    }
    const PoseResult<double> pose = optimise(frame, T_c_w, true);
    ok = pose.inliers >= wanted;
    T_c_w = pose.T_c_w;
    result.inliers = pose.inliers;
  }
  result.state = TrackingState::tracked;
  if (!ok) {
    ok = relocalise(frame, input.depth, T_c_w);
    result.state = ok ? TrackingState::relocalised : TrackingState::lost;
  }
  time_of(result.times, Stage::local_map) = watch.lap_ms();
  if (!ok) {
    ++lost_frames_;
    resting_.release();  // where somebody sat is known only as long as the camera's place is
    time_of(result.times, Stage::tracking) = whole.lap_ms();
    return result;
  }

  // Geometry, fusion, second optimisation on what is left.
  if (uses_geometry(options_.dynamics)) {
    if (geometry_.has_reference()) geometry_.place_reference(map_.pose(reference_id_));
    const cv::Mat moving = geometry_.segment(input, features_->pyramid, T_c_w, semantic, result.geometry);
    if (!semantic.empty()) give_back_resting(*prior, input.depth, moving, result.dynamic_mask);
    cv::bitwise_or(result.dynamic_mask, moving, result.dynamic_mask);
    time_of(result.times, Stage::lucas_kanade) = result.geometry.lk_ms;
    time_of(result.times, Stage::residuals) = result.geometry.residuals_ms;
    time_of(result.times, Stage::free_space) = result.geometry.dense_ms;
    time_of(result.times, Stage::growing) = result.geometry.growing_ms;
    watch.lap_ms();

    const int size = 2 * options_.feature_margin + 1;
    cv::Mat margin;  // a feature is a patch: at the rim of a mover half of it moves
    cv::dilate(result.dynamic_mask, margin, cv::getStructuringElement(cv::MORPH_RECT, {size, size}));
    flag_dynamic(frame, margin);
    int left = 0;
    for (std::size_t i = 0; i < frame.point.size(); ++i)
      left += frame.point[i] >= 0 && frame.dynamic[i] == 0 ? 1 : 0;
    result.mask_rejected = left < options_.min_inliers;
    if (!result.mask_rejected) {
      const PoseResult<double> pose = optimise(frame, T_c_w, true);
      if (pose.inliers >= options_.min_inliers) {
        T_c_w = pose.T_c_w;
        result.inliers = pose.inliers;
      } else {
        result.mask_rejected = true;
      }
    }
    for (std::size_t i = 0; i < frame.point.size(); ++i) {
      if (frame.dynamic[i] == 0 || frame.point[i] < 0) continue;
      ++map_.point(frame.point[i]).on_mover;
      frame.point[i] = -1;
    }
  }
  frame.T_c_w = T_c_w;
  drop_unmatched(frame);
  for (const int p : frame.point) result.matches += p >= 0 ? 1 : 0;
  time_of(result.times, Stage::pose) = watch.lap_ms();

  velocity_ = lost_frames_ == 0 ? T_c_w * last_.T_c_w.inverse() : SE3<double>();
  lost_frames_ = 0;
  if (uses_geometry(options_.dynamics)) geometry_.remember(input.depth, T_c_w, result.dynamic_mask, true);
  if (wants_keyframe(frame, result.inliers)) {
    result.loop = insert_keyframe(frame, input);
    result.keyframe = true;
  }
  result.T_w_c = frame.T_c_w.inverse();
  result.reference = map_.newest();
  result.T_c_reference = frame.T_c_w * map_.keyframes().back().frame.T_c_w.inverse();
  last_ = std::move(frame);
  time_of(result.times, Stage::keyframe) = watch.lap_ms();
  time_of(result.times, Stage::tracking) = whole.lap_ms();
  return result;
}

bool Tracker::wants_keyframe(const Frame& frame, int inliers) const {
  const auto gap = static_cast<int>(frame.index - last_keyframe_index_);
  if (inliers < options_.keyframe_urgent) return true;  // the map in view runs out
  if (gap < options_.keyframe_min_gap) return false;
  if (gap >= options_.keyframe_max_gap) return true;
  if (static_cast<double>(inliers) < options_.keyframe_ratio * static_cast<double>(last_keyframe_tracked_))
    return true;
  const SE3<double> T = frame.T_c_w * map_.keyframes().back().frame.T_c_w.inverse();
  return T.translation().norm() > options_.keyframe_translation ||
         T.so3().log().norm() > options_.keyframe_rotation;
}

bool Tracker::needs_patch(const MapPoint& p, const Frame& frame) const {
  if (p.patch.level < 0) return true;
  // Seen from elsewhere it looks different: a third nearer or farther, or 20 degrees around.
  const SE3<double> T_ref_w = map_.pose(p.patch.keyframe);
  const Eigen::Vector3d before = p.p_w - T_ref_w.inverse().translation(),
                        now = p.p_w - frame.T_c_w.inverse().translation();
  const double ratio = now.norm() / before.norm();
  if (ratio < 0.75 || ratio > 1.33 || now.dot(before) < 0.94 * now.norm() * before.norm()) return true;
  return (T_ref_w.so3() * frame.T_c_w.so3().inverse()).log().norm() > 0.35;
}

void Tracker::cut_patch(MapPoint& p, const Feature& f) const {
  PointPatch patch = PatchMatcher::cut(features_->pyramid, Eigen::Vector2d(f.u, f.v), f.octave);
  if (patch.level < 0) return;
  patch.keyframe = static_cast<int>(map_.keyframes().size());  // the one being made
  patch.ideal = Eigen::Vector2f(f.x, f.y);
  patch.depth = f.depth;
  p.patch = patch;
}

std::optional<LoopClosing> Tracker::insert_keyframe(Frame& frame, const RgbdFrame& input) {
  frame.T_c_w = frame.T_c_w * settle();  // the bundle adjustment writes the map, and so does what follows
  const Eigen::Vector3d centre = frame.T_c_w.inverse().translation();
  // A mover that has just come into view is not found yet. Where enough of the view is known to have
  // stayed, points are made there alone, and newly seen parts have to wait until they are known, too.
  std::vector<std::uint8_t> trusted(frame.features.size(), 1);
  if (uses_geometry(options_.dynamics) && initialised_) {
    int known = 0;
    for (std::size_t i = 0; i < frame.features.size(); ++i) {
      trusted[i] = geometry_.verified_static(frame.features[i].u, frame.features[i].v) ? 1 : 0;
      known += frame.dynamic[i] == 0 && (frame.point[i] >= 0 || trusted[i] != 0) ? 1 : 0;
    }
    if (known < options_.enough_known) trusted.assign(frame.features.size(), 1);
  }
  // New points go where there are none: a second one beside a tracked point tells nothing new.
  constexpr float kSpacing = 6.0F;
  const int columns = static_cast<int>(static_cast<float>(camera_.width) / kSpacing) + 1;
  const int rows = static_cast<int>(static_cast<float>(camera_.height) / kSpacing) + 1;
  occupied_.assign(static_cast<std::size_t>(columns * rows), 0);
  const auto cell_of = [&](const Feature& f) {
    return static_cast<std::size_t>(static_cast<int>(f.v / kSpacing) * columns +
                                    static_cast<int>(f.u / kSpacing));
  };
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    if (frame.point[i] >= 0 && frame.dynamic[i] == 0) occupied_[cell_of(frame.features[i])] = 1;
  }
  int tracked = 0;
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    const Feature& f = frame.features[i];
    if (frame.dynamic[i] != 0) continue;
    const bool has_depth = f.depth > 0 && static_cast<double>(f.depth) <= options_.max_point_depth;
    if (frame.point[i] >= 0) {
      ++tracked;
      MapPoint& p = map_.point(frame.point[i]);
      p.viewing += (p.p_w - centre).normalized();
      if (has_depth && !options_.bundle) {  // information-weighted mean of what the keyframes measured
        const double information = options_.depth_noise.information(static_cast<double>(f.depth));
        p.p_w = (p.information * p.p_w + information * point_of(frame, static_cast<int>(i))) /
                (p.information + information);
        p.information += information;
      }
      if (has_depth && needs_patch(p, frame)) cut_patch(p, f);
      continue;
    }
    if (!has_depth || trusted[i] == 0 || occupied_[cell_of(f)] != 0) continue;
    occupied_[cell_of(f)] = 1;
    MapPoint p;
    p.p_w = point_of(frame, static_cast<int>(i));
    p.viewing = (p.p_w - centre).normalized();
    p.descriptor = frame.descriptors[i];
    p.information = options_.depth_noise.information(static_cast<double>(f.depth));
    p.reference_distance = static_cast<float>((p.p_w - centre).norm());
    p.reference_octave = f.octave;
    p.visible = p.found = 1;
    cut_patch(p, f);
    frame.point[i] = map_.add_point(std::move(p));
    ++tracked;
  }
  frame.grid.build(frame.features, camera_.width, camera_.height);
  const int id = map_.add_keyframe(frame);
  map_.cull();
  std::optional<LoopClosing> loop;
  if (options_.close_loops) {
    loop = loops_.close(map_, places_, id, interop::view<float>(input.depth));
    if (loop) {
      follow(loop->D);
      frame.T_c_w = map_.keyframe(id).frame.T_c_w;
      frame.point = map_.keyframe(id).frame.point;
    }
  }
  places_.add(id, map_.keyframe(id).frame);
  last_keyframe_index_ = frame.index;
  last_keyframe_tracked_ = tracked;
  if (options_.bundle && id > 0) {
    bundle_.start(map_, options_.depth_noise, loop ? options_.loop_bundle_window : 0);
    bundle_due_ =
        frame.index + static_cast<std::size_t>(loop ? options_.loop_bundle_delay : options_.bundle_delay);
  }
  if (uses_geometry(options_.dynamics) &&
      (!geometry_.has_reference() || id - reference_id_ > options_.reference_distance)) {
    geometry_.set_reference(frame, input, features_->pyramid);
    reference_id_ = id;
  }
  return loop;
}

}  // namespace dynslam::runtime
