// SPDX-License-Identifier: BSD-3-Clause
// Chairs and displays of frames that the network did not see.
#include <doctest/doctest.h>

#include <cstddef>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/nets/frame_segmenter.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "run_fixture.hpp"
#include "tiny_onnx.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

struct LabelledWalk {
  test::WalkingSequence folder{24};
  CameraConfig camera;
  std::vector<RgbdFrame> frames;
  std::vector<Masks> masks;

  LabelledWalk() {
    const Sequence sequence = load_sequence(folder.path);
    camera = load_camera(sequence.camera_hint);
    MaskSource truth(folder.path);
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
      frames.push_back(decode_frame(sequence.frames[i], i, camera));
      masks.push_back(truth.read(sequence.frames[i].stamp, camera.width, camera.height).value());
    }
  }
};

const LabelledWalk& labelled_walk() {
  static const LabelledWalk made;
  return made;
}

/// Voxels of furniture after the walk. @param masks_of  frame -> its masks
template <class MasksOf>
std::size_t furniture(MasksOf&& masks_of) {
  SlamOptions options;
  options.dynamics = DynamicsMode::semantic;
  Slam slam(labelled_walk().camera, options);
  for (std::size_t i = 0; i < labelled_walk().frames.size(); ++i)
    (void)slam.track(labelled_walk().frames[i], masks_of(i));
  slam.finish();
  std::size_t count = 0;
  for (auto it = slam.octree()->begin_leafs(); it != slam.octree()->end_leafs(); ++it) {
    if (!slam.octree()->isNodeOccupied(*it)) continue;
    const int label = it->label();
    count += label == static_cast<int>(Label::chair) || label == static_cast<int>(Label::display) ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST_CASE("keyframes take the furniture of the frame that the network saw") {
  const LabelledWalk& walk = labelled_walk();
  const std::size_t all = furniture([&](std::size_t i) { return walk.masks[i]; });
  const auto movers_alone = [&](std::size_t i) {
    Masks masks;
    masks.dynamic = walk.masks[i].dynamic;
    return masks;
  };
  const std::size_t none = furniture(movers_alone);
  const auto earlier = std::make_shared<const EarlierLabels>(
      EarlierLabels{walk.frames[0].t, walk.frames[0].depth, walk.masks[0].labels});
  const std::size_t carried = furniture([&](std::size_t i) {
    Masks masks = movers_alone(i);
    masks.earlier = earlier;
    return masks;
  });
  MESSAGE("voxels of furniture: " << all << " with every frame's labels, " << carried
                                  << " with those of the first");
  CHECK(all > 500);
  CHECK(none == 0);
  CHECK(carried > all / 2);  // the camera moves on to more
  CHECK(carried < all + all / 10);
}

TEST_CASE("labels of a frame that was never tracked are left out; images that are none are refused") {
  const LabelledWalk& walk = labelled_walk();
  const std::size_t unknown = furniture([&](std::size_t i) {
    Masks masks;
    masks.dynamic = walk.masks[i].dynamic;
    masks.earlier = std::make_shared<const EarlierLabels>(
        EarlierLabels{walk.frames[0].t - 1, walk.frames[0].depth, walk.masks[0].labels});
    return masks;
  });
  CHECK(unknown == 0);
  Slam slam(walk.camera, {});
  Masks masks;
  masks.earlier =
      std::make_shared<const EarlierLabels>(EarlierLabels{walk.frames[0].t, walk.frames[0].depth, {}});
  CHECK_THROWS_AS((void)slam.track(walk.frames[0], masks), InputError);
}

TEST_CASE("where the network is to see ten frames a second, time stamps say which") {
  const LabelledWalk& walk = labelled_walk();
  test::write_onnx(walk.folder.path / "colours.onnx", test::colour_network());
  FrameSegmenterOptions options;
  options.segmenter.model = walk.folder.path / "colours.onnx";
  options.every = 0;
  for (const double fps : {30.0, 10.0}) {
    FrameSegmenter segmenter(options);
    for (std::size_t i = 0; i < 7; ++i) {
      RgbdFrame frame = walk.frames[i];
      frame.t = walk.frames[0].t + static_cast<double>(i) / fps + (i % 2 == 0 ? 0.002 : -0.002);
      const FrameMasks out = segmenter.segment(frame, i);
      CHECK((out.masks->earlier == nullptr) == (fps == 10 || i % 3 == 0));
    }
  }
  options.period = 0;
  CHECK_THROWS_AS(FrameSegmenter{options}, UsageError);
}

TEST_CASE("between the frames that the network sees its labels are given along") {
  const LabelledWalk& walk = labelled_walk();
  test::write_onnx(walk.folder.path / "colours.onnx", test::colour_network());
  FrameSegmenterOptions options;
  options.segmenter.model = walk.folder.path / "colours.onnx";
  options.every = 2;
  FrameSegmenter segmenter(options);
  const FrameMasks seen = segmenter.segment(walk.frames[0], 0);
  REQUIRE(seen.masks);
  REQUIRE(cv::countNonZero(seen.masks->labels > static_cast<int>(Label::person)) > 0);
  CHECK_FALSE(seen.masks->earlier);
  const FrameMasks carried = segmenter.segment(walk.frames[1], 1);
  REQUIRE(carried.masks);
  REQUIRE(carried.masks->earlier);
  CHECK(carried.masks->earlier->t == walk.frames[0].t);
  CHECK(cv::countNonZero(carried.masks->earlier->labels != seen.masks->labels) == 0);
  segmenter.reset();
  CHECK_FALSE(segmenter.segment(walk.frames[3], 3).masks->earlier);
}
