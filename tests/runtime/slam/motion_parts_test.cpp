// SPDX-License-Identifier: BSD-3-Clause
// MotionDetection, StaticPose, BackgroundCheck and LastImages over a few frames of a person that walks past,
// each with the pose that the sequence has.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>

#include "dynslam/track/keyframe_inserter.hpp"
#include "rendered_sequence.hpp"
#include "slam/background_check.hpp"
#include "slam/last_images.hpp"
#include "slam/motion_detection.hpp"
#include "slam/static_pose.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const test::RenderedSequence& walking_person() {
  static const test::RenderedSequence rendered([] {
    SynthOptions scene;
    scene.scenario = "walking";
    scene.path = "xyz";
    scene.seed = 2;
    scene.frames = 40;
    scene.width = 320;
    scene.height = 240;
    return scene;
  }());
  return rendered;
}

/// What Tracker does of a frame, without its search for the pose.
struct Walk {
  const test::RenderedSequence& rendered = walking_person();
  TrackerOptions options;
  AnyCamera<double> camera = rendered.camera.model;
  int width = rendered.camera.width, height = rendered.camera.height;
  FeatureExtractor extractor{options.features};
  LocalMap map;
  PlaceIndex places;
  LastFrame<double> last{options.search, 0, height};
  LastImages images{options.alignment, true};
  PoseSolver solver{camera,           width,        height,        extractor.scales(),
                    options.matching, options.pose, options.search};
  MotionDetection motion{camera, motion_options()};
  StaticPose static_pose{
      {options.arbitration, options.search.min_inliers, options.feature_margin}};
  KeyframeInserter<AnyCamera<double>> inserter{camera.pinhole(), camera, width, height};

  static MotionDetectionOptions motion_options() {
    MotionDetectionOptions result;
    result.segmenter.own_reference.use = result.segmenter.pose_check.use = false;
    return result;
  }
  void extract(FrameState& now) {
    auto features = std::make_shared<ImageFeatures>();
    extractor.extract(now.input.gray, *features);
    now.image = features;
    Frame& frame = now.frame();
    frame.t = now.input.t;
    frame.index = now.input.index;
    frame.descriptors = features->descriptors;
    for (const cv::KeyPoint& k : features->keypoints) {
      frame.features.push_back({.u = k.pt.x,
                                .v = k.pt.y,
                                .angle = k.angle,
                                .octave = k.octave,
                                .sigma = extractor.scale(k.octave)});
    }
    solver.begin(now.evidence(map, last), now.pose);
    frame.T_c_w = (rendered.sequence.groundtruth.front().T_w_c.inverse() *
                   rendered.sequence.groundtruth[now.input.index].T_w_c)
                      .inverse();
    now.result.dynamic_mask = cv::Mat::zeros(height, width, CV_8UC1);
  }
  void keep(FrameState& now) {
    const auto trust = [](auto& points, const Frame& of) { points.trust_all(of); };
    now.keyframe =
        inserter.insert(map, places, now.image->pyramid, now.depth, 0, trust, now.frame()).keyframe;
    motion.set_reference(map, now.frame(), solver.placer(), extractor.scales());
  }
  void remember(FrameState& now) {
    const cv::Mat moves = moves_now(now.result);
    motion.remember(now.frame().T_c_w, moves);
    last.accept(now.frame().T_c_w, now.input.t);
    last.replace(std::move(now.frame()), now.time(), {}, map.newest(), now.keyframe);
    images.remember(now, moves, true);
  }
  void begin(FrameState& now) {
    extract(now);
    motion.begin(now);
    keep(now);
    remember(now);
  }
  void prove(FrameState& now) {
    extract(now);
    REQUIRE(solver.prove(now.evidence(map, last), options.search.min_inliers, true, now.pose));
  }
};

double share_of(const cv::Mat& mask, const cv::Mat& of) {
  return cv::countNonZero(mask & of) / static_cast<double>(cv::countNonZero(of));
}

}  // namespace

TEST_CASE("a person that walks past is found, and left out of the pose and of the map") {
  Walk walk;
  int on_mover = 0;
  double found = 0, falsely = 0;
  for (std::size_t i = 0; i < walk.rendered.size(); ++i) {
    const RgbdFrame input = walk.rendered.frame(i);
    FrameState now(input);
    if (i == 0) {
      CHECK(walk.motion.wants_reference(walk.map));
      walk.begin(now);
      CHECK_FALSE(walk.motion.wants_reference(walk.map));
      continue;
    }
    walk.prove(now);
    walk.motion.detect(walk.map, walk.last, {}, now);
    REQUIRE(now.moving.size() == input.gray.size());
    walk.static_pose.optimise(now.evidence(walk.map, walk.last), cv::Mat(), walk.motion, walk.solver, now);
    CHECK(walk.rendered.error(i, now.frame().T_c_w.inverse()) < 0.02);
    CHECK(cv::countNonZero(now.result.dynamic_mask != now.moving) == 0);
    for (std::size_t f = 0; f < now.frame().features.size(); ++f)
      if (now.frame().dynamic[f] != 0) CHECK(now.frame().point[f] < 0);
    const cv::Mat truth = walk.rendered.dynamic_mask(i);
    if (cv::countNonZero(truth) > 1000) {
      found = std::max(found, share_of(now.moving, truth));
      falsely = std::max(falsely, share_of(now.moving, truth == 0));
    }
    walk.solver.matcher().drop_unmatched(now.frame());
    if (i % 10 == 0) walk.keep(now);
    walk.remember(now);
  }
  for (const LocalMap::PointType& p : walk.map.points()) on_mover += p.on_mover > 0 ? 1 : 0;
  CHECK(found > 0.7);
  CHECK(falsely < 0.1);
  CHECK(on_mover > 0);
}

TEST_CASE(
    "a pose that the background confirms stays what it was, after the first frames without being asked") {
  Walk walk;
  const BackgroundCheck check(walk.options.search, walk.camera, walk.options.feature_margin);
  const RgbdFrame first = walk.rendered.frame(0), second = walk.rendered.frame(1);
  FrameState begun(first);
  walk.begin(begun);
  FrameState now(second);
  walk.prove(now);
  const SE3<double> T_c_w = now.frame().T_c_w;
  const int inliers = now.pose.inliers;
  for (const std::size_t age : {std::size_t(1), walk.options.search.young_frames + 1}) {
    check.check(age, true, walk.map, walk.last, walk.images, walk.motion, walk.solver, now);
    CHECK(now.foreground.empty());
    CHECK(now.pose.inliers == inliers);
    CHECK((now.frame().T_c_w * T_c_w.inverse()).log().norm() < 1e-12);
  }
}

TEST_CASE("the last frame's images are copied, aligned with where that is wanted, and dropped") {
  Walk walk;
  RgbdFrame first = walk.rendered.frame(0);
  FrameState begun(first);
  walk.extract(begun);
  LastImages none(walk.options.alignment, false), images(walk.options.alignment, true);
  const cv::Mat moves = cv::Mat::zeros(first.gray.size(), CV_8UC1);
  none.remember(begun, moves, false);
  CHECK_FALSE(none.can_align());
  CHECK_FALSE(none.align(begun.image->pyramid, walk.camera, {}).ok());
  CHECK(none.pyramid().levels.empty());
  images.remember(begun, moves, true);
  const cv::Mat before = first.gray.clone();
  first.gray.setTo(0);  // the caller's again
  REQUIRE_FALSE(images.pyramid().levels.empty());
  CHECK(cv::countNonZero(images.pyramid().levels.front() != before) == 0);
  images.drop_pyramid();
  CHECK(images.pyramid().levels.empty());
  const RgbdFrame second = walk.rendered.frame(1);
  FrameState now(second);
  walk.extract(now);
  CHECK(images.align(now.image->pyramid, walk.camera, {}).ok());
}
