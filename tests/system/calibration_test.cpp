// SPDX-License-Identifier: BSD-3-Clause
// People and a pushed chair on a floor, walls and tables touched: the beliefs of what moves are as often right as they say.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/eval/reliability.hpp"
#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/interop/opencv.hpp"
#include "rendered_sequence.hpp"

using namespace dynslam;

TEST_CASE("of the cells that are said to move with a probability, as many do") {
  runtime::SynthOptions scene;
  scene.scenario = "crowd";
  scene.path = "xyz";
  scene.seed = 4;
  scene.frames = 60;
  const test::RenderedSequence sequence(scene);
  MotionSegmenter<double, AnyCamera<double>> segmenter(sequence.camera.model);
  ReliabilityDiagram diagram;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const runtime::RgbdFrame frame = sequence.frame(i);
    const auto depth = interop::view<const float>(frame.depth);
    const SE3<double> T_c_w = sequence.sequence.groundtruth[i].T_w_c.inverse();
    const auto& motion = segmenter.segment(interop::view<const std::uint8_t>(frame.gray), depth, frame.t, T_c_w);
    REQUIRE(motion.ok());
    CHECK_FALSE(motion.own_pose);  // the true pose is believed
    const cv::Mat truth = sequence.dynamic_mask(i);
    for (std::size_t c = 0; i > 3 && c < segmenter.grid().cells(); ++c) {  // at first nothing can be known
      const RecordedPixel p = segmenter.grid().pixel_of(c);
      if (p.u >= 0 && is_valid_depth(depth(p.u, p.v)))
        diagram.add(segmenter.belief().data()[c], truth.at<std::uint8_t>(p.v, p.u) != 0);
    }
    segmenter.remember(T_c_w, motion.mask);
  }
  for (std::size_t k = 0; k < 10; ++k) {
    const auto t = diagram.tenth(k);
    CAPTURE(k);
    CAPTURE(t.statements);
    CAPTURE(t.said);
    CAPTURE(t.happened);
    if (100 * t.statements >= diagram.statements()) CHECK(std::abs(t.said - t.happened) <= 0.1);
  }
  CHECK(100 * diagram.tenth(9).statements > diagram.statements());  // it commits itself
  CHECK(100 * diagram.tenth(0).statements > diagram.statements());
}
