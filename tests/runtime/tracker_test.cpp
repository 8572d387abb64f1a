// SPDX-License-Identifier: BSD-3-Clause
// The tracker as a class of its own, fed by a caller who owns the images.
#include "dynslam/runtime/slam/tracker.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "rendered_sequence.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr int kWalkFrames = 50;

/// People walking, and one who sits, rendered once for all tests of this file.
struct Walking {
  test::WalkingSequence folder{kWalkFrames};
  Sequence sequence = load_sequence(folder.path);
  CameraConfig camera = load_camera(sequence.camera_hint);

  [[nodiscard]] RgbdFrame frame(std::size_t i) const { return decode_frame(sequence.frames[i], i, camera); }
  [[nodiscard]] Masks masks(std::size_t i) const {
    const std::string name = sequence.frames[i].stamp + ".png";
    Masks m;
    m.labels = cv::imread((folder.path / "label" / name).string(), cv::IMREAD_UNCHANGED);
    m.instances = cv::imread((folder.path / "instance" / name).string(), cv::IMREAD_UNCHANGED);
    m.dynamic = m.labels == static_cast<int>(Label::person);
    return m;
  }
};

const Walking& rendered_walk() {
  static const Walking sequence;
  return sequence;
}

/// A board that is carried past, in the first frame, too.
test::RenderedSequence carried_board(const std::string& path, int frames) {
  SynthOptions scene;
  scene.scenario = "board";
  scene.path = path;
  scene.seed = 3;
  scene.frames = frames;
  return test::RenderedSequence(scene);
}

TrackerOptions options(DynamicsMode mode) {
  TrackerOptions o;
  o.dynamics = mode;
  return o;
}

/// Bytes of everything that a result says about the pose.
std::string bytes_of(const TrackResult& r) {
  std::string text(std::to_string(static_cast<int>(r.state)) + ',' + std::to_string(r.inliers) + ',');
  const Eigen::Matrix4d T = r.T_w_c.matrix();
  text.append(reinterpret_cast<const char*>(T.data()), sizeof(double) * 16);
  return text;
}

/// A buffer that a driver fills again and again, with a rim as some drivers have.
struct Buffers {
  cv::Mat gray{480 + 64, 640 + 64, CV_8UC1, cv::Scalar(0)}, depth{480, 640, CV_32FC1},
      dynamic{480, 640, CV_8UC1};

  RgbdFrame fill(const RgbdFrame& from) {
    RgbdFrame to = from;
    to.gray = gray(cv::Rect(32, 32, 640, 480));
    from.gray.copyTo(to.gray);
    from.depth.copyTo(depth);
    to.depth = depth;
    return to;
  }
  void overwrite() {
    gray.setTo(77);
    depth.setTo(1.0);
    dynamic.setTo(255);
  }
};

}  // namespace

TEST_CASE("images and masks of another size or type than the camera's are refused before anything changes") {
  const Walking& w = rendered_walk();
  Tracker tracker(w.camera, options(DynamicsMode::both)), undisturbed(w.camera, options(DynamicsMode::both));
  const auto both = [&](std::size_t i) {
    const std::string expected = bytes_of(undisturbed.track(w.frame(i), w.masks(i)));
    CHECK(bytes_of(tracker.track(w.frame(i), w.masks(i))) == expected);
  };
  const auto refused = [&](std::size_t i, auto&& spoil, const char* why) {
    RgbdFrame frame = w.frame(i);
    std::optional<Masks> masks = w.masks(i);
    spoil(frame, *masks);
    CAPTURE(why);
    CHECK_THROWS_WITH_AS((void)tracker.track(frame, masks), doctest::Contains(why), InputError);
  };
  both(0);
  refused(
      1, [](RgbdFrame& f, Masks&) { f.gray = f.gray(cv::Rect(0, 0, 320, 240)); },
      "the grey image is 320x240 CV_8UC1, not 640x480 CV_8UC1");
  refused(
      1, [](RgbdFrame& f, Masks&) { f.gray = f.bgr; }, "the grey image is 640x480 CV_8UC3");
  refused(
      1, [](RgbdFrame& f, Masks&) { f.gray = cv::Mat(); }, "the grey image is empty");
  refused(
      1, [](RgbdFrame& f, Masks&) { f.depth = cv::Mat(240, 640, CV_32FC1, cv::Scalar(1)); },
      "the depth image is 640x240");
  refused(
      1, [](RgbdFrame& f, Masks&) { f.depth.convertTo(f.depth, CV_16U, 5000); },
      "the depth image is 640x480 CV_16UC1");
  refused(
      1, [](RgbdFrame& f, Masks&) { f.depth = cv::Mat(); }, "the depth image is empty");
  refused(
      1, [](RgbdFrame&, Masks& m) { m.dynamic = cv::Mat::zeros(10, 10, CV_8UC1); },
      "the a-priori mask is 10x10");
  refused(
      1, [](RgbdFrame&, Masks& m) { m.dynamic.convertTo(m.dynamic, CV_32F); },
      "the a-priori mask is 640x480 CV_32FC1");
  refused(
      1, [](RgbdFrame&, Masks& m) { m.labels = cv::Mat::zeros(480, 10, CV_8UC1); },
      "the label image is 10x480");
  refused(
      1, [](RgbdFrame&, Masks& m) { m.instances = m.dynamic; }, "the instance image is 640x480 CV_8UC1");
  both(1);
  refused(
      1, [](RgbdFrame&, Masks&) {}, "does not come after");
  refused(
      0, [](RgbdFrame&, Masks&) {}, "does not come after");
  refused(
      2, [](RgbdFrame& f, Masks&) { f.t = std::nan(""); }, "is not a number");
  refused(
      2, [](RgbdFrame& f, Masks&) { f.t = std::numeric_limits<double>::infinity(); }, "is not a number");
  refused(
      2, [](RgbdFrame& f, Masks&) { f.depth_delay = std::nan(""); }, "is not a number");
  both(2);
}

TEST_CASE("the tracker counts frames itself: a caller who numbers none of them gets the same poses") {
  const Walking& w = rendered_walk();
  Tracker numbered(w.camera, options(DynamicsMode::geometric)),
      unnumbered(w.camera, options(DynamicsMode::geometric));
  for (std::size_t i = 0; i < 20; ++i) {
    RgbdFrame frame = w.frame(i);
    const std::string expected = bytes_of(numbered.track(frame, std::nullopt));
    frame.index = 0;
    CHECK(bytes_of(unnumbered.track(frame, std::nullopt)) == expected);
  }
  numbered.finish();
  unnumbered.finish();
  CHECK(numbered.map().keyframes().size() > 2);
  CHECK(numbered.map().keyframes().size() == unnumbered.map().keyframes().size());
}

TEST_CASE("a caller who fills the same images again and again gets the poses of one who does not") {
  const Walking& w = rendered_walk();
  for (const auto mode : {DynamicsMode::none, DynamicsMode::both}) {
    Tracker fresh(w.camera, options(mode)), reused(w.camera, options(mode));
    Buffers buffers;
    for (std::size_t i = 0; i < 30; ++i) {
      const RgbdFrame frame = w.frame(i);
      Masks masks = w.masks(i);
      const TrackResult expected = fresh.track(frame, masks);
      masks.dynamic.copyTo(buffers.dynamic);
      masks.dynamic = buffers.dynamic;
      const TrackResult result = reused.track(buffers.fill(frame), masks);
      buffers.overwrite();
      CHECK(bytes_of(result) == bytes_of(expected));
      CHECK(cv::norm(result.dynamic_mask, expected.dynamic_mask, cv::NORM_L1) == 0);
    }
  }
}

TEST_CASE("who was at rest before the camera was lost is not taken to be so afterwards") {
  const Walking& w = rendered_walk();
  Tracker tracker(w.camera, options(DynamicsMode::both));
  std::size_t i = 0;
  const auto at_rest = [](const TrackResult& r) { return cv::countNonZero(r.dynamic_mask == kMayMove); };
  for (; i + 1 < kWalkFrames; ++i) {
    const TrackResult result = tracker.track(w.frame(i), w.masks(i));
    REQUIRE(result.state == TrackingState::tracked);
    if (at_rest(result) > 500) break;
  }
  REQUIRE(i + 1 < kWalkFrames);  // who sits
  RgbdFrame black = w.frame(i + 1);
  black.gray.setTo(0);
  const TrackResult lost = tracker.track(black, w.masks(i + 1));
  CHECK(lost.state == TrackingState::lost);
  CHECK(at_rest(lost) == 0);
  CHECK(cv::countNonZero(lost.dynamic_mask == kMovesNow) > 0);
}

TEST_CASE("what stands still serves the pose, also where a mask without instances suspects it") {
  const Walking& w = rendered_walk();
  Masks wrong;  // says of the right half of the view that it may move, always
  wrong.dynamic = cv::Mat::zeros(480, 640, CV_8UC1);
  wrong.dynamic.colRange(320, 640) = 255;
  const auto last_of = [&](DynamicsMode mode, const std::optional<Masks>& masks) {
    Tracker tracker(w.camera, options(mode));
    TrackResult last;
    for (std::size_t i = 0; i < kWalkFrames; ++i) last = tracker.track(w.frame(i), masks);
    CHECK(last.state == TrackingState::tracked);
    return last;
  };
  const TrackResult without = last_of(DynamicsMode::geometric, std::nullopt),
                    both = last_of(DynamicsMode::both, wrong),
                    semantic = last_of(DynamicsMode::semantic, wrong);
  CHECK(both.inliers > 0.8 * without.inliers);
  CHECK(semantic.inliers < 0.8 * without.inliers);  // where nothing tells what stands
  // Out of the map it stays.
  CHECK(cv::countNonZero(both.dynamic_mask & wrong.dynamic) == cv::countNonZero(wrong.dynamic));
}

TEST_CASE(
    "masks that cover nearly all of the view, always or now and then, cost no frame and no centimetre") {
  const Walking& w = rendered_walk();
  const auto run = [&](DynamicsMode mode, auto&& mask_of) {
    Tracker tracker(w.camera, options(mode));
    int rejected = 0, tracked = 0;
    TrackResult last;
    for (std::size_t i = 0; i < kWalkFrames; ++i) {
      const TrackResult r = tracker.track(w.frame(i), mask_of(i));
      tracked += r.state == TrackingState::tracked ? 1 : 0;
      rejected += r.mask_rejected != MaskVerdict::kept ? 1 : 0;
      last = r;
    }
    CAPTURE(static_cast<int>(mode));
    CHECK(tracked == kWalkFrames);
    return std::pair(last, rejected);
  };
  const auto geometric = run(DynamicsMode::geometric, [](std::size_t) { return std::optional<Masks>(); });
  Masks cover;
  cover.dynamic = cv::Mat(480, 640, CV_8UC1, cv::Scalar(255));
  cover.dynamic.colRange(600, 640) = 0;
  cover.dynamic.convertTo(cover.instances, CV_16U, 1 / 255.0);  // one object
  const auto now_and_then = [&](std::size_t i) { return i % 3 == 1 ? std::optional(cover) : std::nullopt; };
  for (const DynamicsMode mode : {DynamicsMode::both, DynamicsMode::semantic}) {
    const auto always = run(mode, [&](std::size_t) { return std::optional(cover); });
    const auto sometimes = run(mode, now_and_then);
    if (mode == DynamicsMode::semantic) {  // people walk here, and nothing else tells of them
      CHECK(always.second == kWalkFrames);
      CHECK(sometimes.second >= kWalkFrames / 3);
      continue;
    }
    for (const auto& found : {always, sometimes})
      CHECK((found.first.T_w_c.translation() - geometric.first.T_w_c.translation()).norm() < 0.01);
    // The room is soon known to be static, and no longer suspected.
    CHECK(always.second >= 1);
    CHECK(always.second < 10);
    CHECK(cv::countNonZero(always.first.dynamic_mask == kMayMove) > 640 * 480 / 2);
  }
}

TEST_CASE("a mask that kept the room out of the map does not lose the camera when the rest is hidden") {
  const Walking& w = rendered_walk();
  constexpr int kHidden = 4, kFrames = 8;
  // The network takes the right two thirds of the view for a person, always; then something covers the rest.
  const cv::Rect open(0, 0, 213, 480);
  const auto lost_frames = [&](DynamicsMode mode) {
    Tracker tracker(w.camera, options(mode));
    int lost = 0;
    for (std::size_t i = 0; i < kFrames; ++i) {
      RgbdFrame frame = w.frame(i);
      Masks masks = w.masks(i);
      masks.dynamic.setTo(255);
      masks.dynamic(open).setTo(0);
      if (i >= kHidden) {
        frame.gray(open).setTo(40);
        frame.depth(open).setTo(std::numeric_limits<double>::quiet_NaN());
      }
      lost += tracker.track(frame, masks).ok() ? 0 : 1;
    }
    return lost;
  };
  CHECK(lost_frames(DynamicsMode::semantic) == kFrames - kHidden);  // nothing contradicts the network
  // Where geometry tells what stands, the first keyframe has points under the mask, too.
  CHECK(lost_frames(DynamicsMode::both) == 0);
}

TEST_CASE(
    "a board that is carried from the first frame on and has most of the features is not taken for the "
    "room") {
  const test::RenderedSequence board = carried_board("xyz", 8);
  const auto error = [&](std::size_t young_frames,
                         double foreground_share) {  // of the last frame's place [m]
    TrackerOptions o = options(DynamicsMode::geometric);
    o.seed = 3;
    o.search.young_frames = young_frames;
    o.search.foreground_share = foreground_share;
    Tracker tracker(board.camera, o);
    TrackResult last;
    for (std::size_t i = 0; i < board.size(); ++i) last = tracker.track(board.frame(i), std::nullopt);
    CHECK(last.state == TrackingState::tracked);
    return board.error(board.size() - 1, last.T_w_c);
  };
  const PoseSearchOptions usual;
  CHECK(error(usual.young_frames, usual.foreground_share) < 0.005);
  CHECK(error(0, usual.foreground_share) > 0.05);  // never asked
  CHECK(error(usual.young_frames, 1) > 0.05);      // asked of no pose
  CHECK(error(usual.young_frames, 0) < 0.005);     // of every pose
}

TEST_CASE("a lost camera is not found beside a board that stood in the first frame and was carried away") {
  const test::RenderedSequence board = carried_board("static", 24);
  // The room is out of sight for a while, and then there is nothing but the board.
  constexpr std::size_t kDark = 15, kBoard = 20;
  const auto found_again = [&] {
    Tracker tracker(board.camera, options(DynamicsMode::geometric));
    int found = 0;
    for (std::size_t i = 0; i < board.size(); ++i) {
      RgbdFrame frame = board.frame(i);
      if (i >= kDark) {
        const cv::Mat hidden = i < kBoard ? cv::Mat(frame.gray.size(), CV_8UC1, cv::Scalar(255))
                                          : cv::Mat(board.dynamic_mask(i) == 0);
        frame.gray.setTo(40, hidden);
        frame.depth.setTo(std::numeric_limits<double>::quiet_NaN(), hidden);
      }
      const TrackResult r = tracker.track(frame, std::nullopt);
      if (i < kDark) CHECK(r.ok());
      found += i >= kBoard && r.ok() ? 1 : 0;
    }
    return found;
  };
  CHECK(found_again() == 0);
}

TEST_CASE("a mask that leaves next to nothing is believed where that tells where the camera is") {
  const test::RenderedSequence board = carried_board("static", 30);
  // Somebody carries a board past, and all but a strip of the room is a blur: the board has nearly all
  // features.
  constexpr std::size_t kBlurred = 8;
  const cv::Rect open(0, 0, 60, 480);
  Tracker tracker(board.camera, options(DynamicsMode::semantic));
  TrackResult last;
  int covered = 0;
  for (std::size_t i = 0; i < board.size(); ++i) {
    RgbdFrame frame = board.frame(i);
    Masks masks;
    masks.dynamic = board.dynamic_mask(i);
    if (i >= kBlurred) {
      cv::Mat without, blurred, room = masks.dynamic == 0;
      cv::dilate(masks.dynamic, without, cv::Mat(), {-1, -1}, 3);
      room.setTo(0, without);
      room(open).setTo(0);
      cv::GaussianBlur(frame.gray, blurred, {0, 0}, 8);
      blurred.copyTo(frame.gray, room);
    }
    last = tracker.track(frame, masks);
    CHECK(last.ok());
    covered += last.mask_rejected == MaskVerdict::covers_view ? 1 : 0;
  }
  CHECK(covered == 0);
  CHECK(last.T_w_c.translation().norm() < 0.01);  // the camera stands
}
