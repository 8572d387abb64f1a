// SPDX-License-Identifier: BSD-3-Clause
// Masks of a network that takes longer than a frame.
#include "nets/late_masks.hpp"

#include <doctest/doctest.h>

#include <opencv2/imgproc.hpp>
#include <thread>
#include <vector>

#include "dynslam/runtime/io/frame_stream.hpp"
#include "run_fixture.hpp"
#include "tiny_onnx.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

struct LateWalk {
  test::WalkingSequence folder{10};
  std::vector<RgbdFrame> frames;
  FrameSegmenterOptions options;

  LateWalk() {
    const Sequence sequence = load_sequence(folder.path);
    const CameraConfig camera = load_camera(sequence.camera_hint);
    for (std::size_t i = 0; i < sequence.frames.size(); ++i)
      frames.push_back(decode_frame(sequence.frames[i], i, camera));
    test::write_onnx(folder.path / "colours.onnx", test::colour_network());
    options.segmenter.model = folder.path / "colours.onnx";
  }
  void wait(const LateMasks& masks) const {
    while (masks.busy()) std::this_thread::yield();
  }
};

LateWalk& late_walk() {
  static LateWalk made;
  return made;
}

}  // namespace

TEST_CASE("what the network found is carried from its frame to the one at hand, until it is too old") {
  const auto& f = late_walk().frames;
  LateMasks masks(late_walk().options, 0.15);  // four frames
  CHECK_FALSE(masks.next(f[0]).masks);
  late_walk().wait(masks);
  const LateMasks::Carried third = masks.next(f[3]);
  REQUIRE(third.masks);
  CHECK(third.age == doctest::Approx(0.1));
  CHECK(third.network_ms > 0);
  CHECK(masks.seen() == 1);

  OnnxSegmenter network(late_walk().options.segmenter);
  MaskKeeper keeper;
  (void)keeper.update(network.segment(f[0].bgr), f[0].gray, f[0].depth);
  const Masks expected = keeper.update(std::nullopt, f[3].gray, f[3].depth);
  CHECK(cv::countNonZero(expected.dynamic) > 1000);
  CHECK(cv::countNonZero(expected.dynamic != third.masks->dynamic) == 0);

  late_walk().wait(masks);  // frame 3 was seen
  const LateMasks::Carried fourth = masks.next(f[4]);
  CHECK(fourth.age == doctest::Approx(1.0 / 30));
  late_walk().wait(masks);  // and 4
  const LateMasks::Carried late = masks.next(f[9]);
  CHECK_FALSE(late.masks);  // 0.167 s
}

TEST_CASE("frames that come while the network is busy are caught up with, be they few or many") {
  const RgbdFrame& still = late_walk().frames[0];  // nothing moves: whichever are left out, the masks stay
  OnnxSegmenter network(late_walk().options.segmenter);
  MaskKeeper keeper;
  const cv::Mat first = keeper.update(network.segment(still.bgr), still.gray, still.depth).dynamic;
  // How often they are carried is a matter of how fast the two threads are; what that adds has an end.
  cv::Mat most;
  const int reach = 2 * MaskKeeperOptions().most_band + 1;
  cv::dilate(first, most, cv::getStructuringElement(cv::MORPH_RECT, {reach, reach}));
  LateMasks masks(late_walk().options, 1000);
  double t = still.t;
  for (const int frames : {1, 2, 9, 60}) {
    CAPTURE(frames);
    LateMasks::Carried carried;
    for (int k = 0; k < frames; ++k) {
      RgbdFrame frame = still;
      frame.t = t += 1.0 / 30;
      carried = masks.next(frame);
    }
    late_walk().wait(masks);
    RgbdFrame frame = still;
    frame.t = t += 1.0 / 30;
    carried = masks.next(frame);
    REQUIRE(carried.masks);
    CHECK(carried.age < (frames + 1.5) / 30);
    CHECK(cv::countNonZero(carried.masks->dynamic & first) > 0.9 * cv::countNonZero(first));
    CHECK(cv::countNonZero(carried.masks->dynamic & ~most) == 0);
    late_walk().wait(masks);
  }
}

TEST_CASE("every: the network gets every so many frames alone; what it meets reaches the caller") {
  const auto& f = late_walk().frames;
  FrameSegmenterOptions options = late_walk().options;
  options.every = 3;
  LateMasks masks(options, 10);
  std::size_t expected = 0;
  for (std::size_t i = 0; i < 7; ++i) {
    (void)masks.next(f[i]);
    late_walk().wait(masks);
    CHECK(masks.seen() == expected);  // those found by the frames before this one
    if (i % 3 == 0) ++expected;
  }
  LateMasks broken(late_walk().options, 10);
  RgbdFrame without_colour = f[0];
  without_colour.bgr.release();
  (void)broken.next(without_colour);
  late_walk().wait(broken);
  CHECK_THROWS((void)broken.next(f[1]));
}
