// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/tracker.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "dynslam/features/masked_features.hpp"
#include "io/argument_check.hpp"
#include "slam/input_check.hpp"
#include "slam/tracker_parts.hpp"

namespace dynslam::runtime {

std::string_view to_string(TrackingState state) {
  constexpr std::array<std::string_view, 4> kNames{"not initialised", "tracked", "relocalised", "lost"};
  return kNames[static_cast<std::size_t>(state)];
}

Tracker::Tracker(const CameraConfig& camera, const TrackerOptions& options)
    : parts_(std::make_unique<Parts>(camera, options)) {}

Tracker::~Tracker() = default;

void Tracker::measure_readout() {
  parts_->solver.measure_readout();
}
const std::optional<ReadoutMeasurement<double>>& Tracker::readout() const {
  return parts_->solver.readout();
}
const LocalMap& Tracker::map() const {
  return parts_->map;
}
std::size_t Tracker::adjustments() const {
  return parts_->bundles.adjustments();
}
const MotionResult<double>* Tracker::motion() const {
  return parts_->motion ? &parts_->motion->motion() : nullptr;
}

TrackResult Tracker::track(const RgbdFrame& input, const std::optional<Masks>& prior) {
  Parts& p = *parts_;
  check_input(input, prior, p.camera, p.sequence.last_t);
  p.sequence.last_t = input.t;
  FrameState now(input);
  extract(now);
  p.prior_mask.apply(prior, now);
  now.done(Stage::features, input.preparation_ms);

  if (p.bundles.due(now.frame().index)) finish();
  if (p.map.keyframes().empty()) {
    start_map(now);
    now.done(Stage::keyframe);
    return now.finish();
  }

  now.result.state = locate(now) ? TrackingState::tracked : locate_lost(now);
  now.done(Stage::local_map);
  if (now.result.state == TrackingState::lost) {
    lose();
    return now.finish();
  }

  if (p.motion) find_dynamic(now);
  revise_last(now);
  accept(now);
  now.done(Stage::pose);
  const cv::Mat moves = moves_now(now.result);
  if (p.motion) p.motion->remember(now.frame().T_c_w, moves);
  if (p.inserter.wants(p.map, now.frame(), now.pose.inliers)) keep(now);
  if (p.motion && p.motion->reference_stale())
    p.motion->set_reference(p.map, now.frame(), p.solver.placer(), p.extractor.scales());
  now.result.T_w_c = now.frame().T_c_w.inverse();
  now.result.reference = p.map.newest();
  now.result.T_c_reference = now.frame().T_c_w * p.map.pose(p.map.newest()).inverse();
  remember(now, moves);
  now.done(Stage::keyframe);
  return now.finish();
}

void Tracker::extract(FrameState& now) {
  Parts& p = *parts_;
  now.image = now.input.features;
  if (!now.image) {
    auto own = std::make_shared<ImageFeatures>();
    p.extractor.extract(now.input.gray, *own);
    now.image = std::move(own);
  }
  const auto& keypoints = now.image->keypoints;
  Frame& frame = now.frame();
  frame.descriptors = now.image->descriptors;
  frame.index = p.sequence.frames++;
  frame.t = now.input.t;
  frame.features.resize(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const cv::KeyPoint& k = keypoints[i];
    const float sigma = p.extractor.scale(k.octave) *
                        p.solver.placer().stretch(Eigen::Vector2f(k.pt.x, k.pt.y).cast<double>());
    frame.features[i] = {.u = k.pt.x, .v = k.pt.y, .angle = k.angle, .octave = k.octave, .sigma = sigma};
  }
  now.pose.plain = p.options.additions == Additions::none;
  p.solver.begin(now.evidence(p.map, p.last), now.pose);
}

void Tracker::start_map(FrameState& now) {
  Parts& p = *parts_;
  const auto enough = [&] {
    return unmasked_with_depth(now.frame().features, now.frame().dynamic) >= p.options.initial_features;
  };
  if (now.mask_covers_view) PriorMask::reject(MaskVerdict::covers_view, now);
  if (!enough() && !(PriorMask::reject(MaskVerdict::starved, now) && enough())) return;
  if (p.motion) p.motion->begin(now);
  keep(now);
  p.sequence.map_begin = now.frame().index;
  p.sequence.began_at_rest = p.camera.readout_time != 0;
  now.result.state = TrackingState::tracked;
  now.pose.inliers = p.inserter.tracked();
  if (p.motion) p.motion->remember(now.frame().T_c_w, now.result.dynamic_mask);
  remember(now, now.result.dynamic_mask);
}

bool Tracker::locate(FrameState& now) {
  Parts& p = *parts_;
  const auto check_background = [&] {
    if (p.motion)
      p.background.check(now.frame().index - p.sequence.map_begin, p.locator.strict(now), p.map, p.last,
                         p.last_images, *p.motion, p.solver, now);
  };
  bool located = p.locator.locate_with_prior(p.map, p.last, p.last_images, p.solver, now);
  if (located) check_background();
  if (located && rebuild_initial_map(now)) {
    located = p.locator.locate(p.map, p.last, p.last_images, p.solver, now);
    if (located) check_background();
  }
  p.sequence.began_at_rest = false;
  return located;
}

TrackingState Tracker::locate_lost(FrameState& now) {
  Parts& p = *parts_;
  now.pose.plain = true;  // what keeps dynamic objects out must not lose the camera: without it, at last
  if (p.relocaliser.locate(now.evidence(p.map, p.last), p.places, p.solver, now.pose))
    return TrackingState::relocalised;
  const bool located = p.locator.locate(p.map, p.last, p.last_images, p.solver, now) ||
                       p.locator.locate_by_alignment(p.map, p.last, p.last_images, p.solver, now);
  return located ? TrackingState::tracked : TrackingState::lost;
}

bool Tracker::rebuild_initial_map(const FrameState& now) {
  Parts& p = *parts_;
  if (!p.sequence.began_at_rest || !p.last.interval(now.input.t)) return false;
  Frame& first = p.last.frame();
  p.last.set_velocity(now.frame().T_c_w * first.T_c_w.inverse(), p.last.velocity_interval());
  const RollingShutter<double> shutter = p.last.shutter(now.input.t, p.last.velocity());
  p.solver.placer().set_rolling_shutter(shutter);
  for (Feature& f : first.features) p.solver.placer().bring_to_middle(f);
  std::fill(first.point.begin(), first.point.end(), -1);
  p.map = LocalMap();
  p.places = PlaceIndex();
  p.inserter.begin(p.map, p.places, p.last_images.pyramid(), first);
  p.last_images.drop_pyramid();
  if (!p.motion) return true;
  p.motion->segmenter().set_rolling_shutter(shutter);  // its images are still the last frame's
  p.motion->set_reference(p.map, first, p.solver.placer(), p.extractor.scales());
  return true;
}

void Tracker::lose() {
  Parts& p = *parts_;
  p.last.release_keyframe();
  p.bundles.start(p.map);
  p.last.lose();
  p.prior_mask.forget_static();
}

void Tracker::find_dynamic(FrameState& now) {
  Parts& p = *parts_;
  p.motion->detect(p.map, p.last, p.solver.placer().rolling_shutter(), now);
  if (now.prior != nullptr && p.options.method == MotionMethod::full) {
    p.prior_mask.mark_static(
        [&](int u, int v) { return p.motion->verified_static(static_cast<float>(u), static_cast<float>(v)); },
        now);
  }
  now.watch.lap_ms();
  p.static_pose.optimise(now.evidence(p.map, p.last), p.prior_mask.static_surfaces(), *p.motion, p.solver,
                         now);
}

void Tracker::revise_last(FrameState& now) {
  Parts& p = *parts_;
  const auto pose = p.revision.revise(p.map, p.last, now.input.t, now.frame().T_c_w, p.solver);
  if (pose) {
    const int reference = p.last.reference();
    now.result.revised = RevisedPose{.t = p.last.time().t,
                                     .ns = p.last.time().ns,
                                     .reference = reference,
                                     .T_c_reference = p.last.frame().T_c_w * p.map.pose(reference).inverse(),
                                     .covariance = pose->covariance,
                                     .inliers = pose->inliers};
  }
  // The keyframe that the last frame became, if it did, is as it stays: what waited for that begins.
  p.last.release_keyframe();
  p.bundles.start(p.map);
}

void Tracker::accept(FrameState& now) {
  Parts& p = *parts_;
  Frame& frame = now.frame();
  p.solver.matcher().drop_unmatched(frame);
  for (const int point : frame.point) now.result.matches += point >= 0 ? 1 : 0;
  p.last.accept(frame.T_c_w, now.input.t);
}

void Tracker::keep(FrameState& now) {
  Parts& p = *parts_;
  Frame& frame = now.frame();
  frame.T_c_w = frame.T_c_w * apply_bundle();  // that writes the map, and so does what follows
  // Where a mask was rejected a dynamic object may be on what it covered.
  const bool proven_alone =
      p.motion && p.options.method == MotionMethod::full && now.result.mask_rejected != MaskVerdict::kept;
  const auto trust = [&](PointMaker<double>& points, const Frame& of) {
    points.trust_all(of);
    if (proven_alone) points.trust(of, [&](float u, float v) { return p.motion->verified_static(u, v); });
  };
  KeyframeInsertion<double> inserted =
      p.inserter.insert(p.map, p.places, now.image->pyramid, now.depth, now.result.matches, trust, frame);
  now.keyframe = inserted.keyframe;
  now.result.keyframe = true;
  now.result.loop = std::move(inserted.loop);
  if (now.result.loop) follow(now.result.loop->D);
  if (p.options.bundle && now.keyframe && *now.keyframe > 0)
    p.bundles.request(frame.index, now.result.loop.has_value());
  if (p.motion && p.motion->wants_reference(p.map))
    p.motion->set_reference(p.map, frame, p.solver.placer(), p.extractor.scales());
}

void Tracker::remember(FrameState& now, const cv::Mat& moves) {
  Parts& p = *parts_;
  p.last.replace(std::move(now.frame()), now.time(), p.solver.placer().rolling_shutter(), p.map.newest(),
                 now.keyframe);
  p.last_images.remember(now, moves, p.sequence.began_at_rest);
}

SE3<double> Tracker::apply_bundle() {
  const auto D = parts_->bundles.apply(parts_->map, parts_->places);
  if (!D) return {};
  follow(*D);
  return *D;
}

void Tracker::follow(const SE3<double>& D) {
  parts_->last.follow(D);
  if (parts_->motion) parts_->motion->follow(D);
}

void Tracker::finish() {
  (void)apply_bundle();
}

void Tracker::load(LocalMap map) {
  Parts& p = *parts_;
  check_argument(p.map.keyframes().empty() && p.sequence.frames == 0,
                 "Tracker::load() comes before the first frame");
  check_argument(!map.keyframes().empty(), "Tracker::load(): the map has no keyframe");
  p.map = std::move(map);
  for (const Keyframe& k : p.map.keyframes()) {
    if (!k.culled()) p.places.add(k.id, k.frame);
  }
  p.last.lose();
}

int Tracker::adopt(const LocalMap& other, const SE3<double>& T_w_other) {
  finish();  // the adjustment's thread knows keyframes by their address
  Parts& p = *parts_;
  const int first = p.map.append(other, T_w_other);
  for (int id = first; id <= p.map.newest(); ++id) {
    if (!p.map.keyframe(id).culled()) p.places.add(id, p.map.keyframe(id).frame);
  }
  return first;
}

}  // namespace dynslam::runtime
