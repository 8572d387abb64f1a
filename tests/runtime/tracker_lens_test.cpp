// SPDX-License-Identifier: BSD-3-Clause
// Cameras whose lens has no inverse in the corners of the image.
#include <doctest/doctest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "dynslam/runtime/slam/tracker.hpp"
#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

TEST_CASE("pixels for which the lens has no inverse make no map points") {
  CameraConfig camera;
  // Nothing is seen farther than 0.54 focal lengths from the centre; the corners of the image are at 1.0.
  camera.model = PinholeBrownConrady<double>(Pinhole<double>(400, 400, 319.5, 239.5),
                                             BrownConrady<double>(-0.5, 0, 0, 0, 0));
  test::Rng rng("folded lens");
  RgbdFrame frame;
  frame.gray = cv::Mat(camera.height, camera.width, CV_8UC1);
  for (int v = 0; v < camera.height; v += 8) {
    for (int u = 0; u < camera.width; u += 8)
      frame.gray(cv::Rect(u, v, 8, 8)) = static_cast<double>(rng.integer(0, 255));
  }
  cv::cvtColor(frame.gray, frame.bgr, cv::COLOR_GRAY2BGR);
  frame.depth = cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar(2.0));
  TrackerOptions options;
  options.dynamics = DynamicsMode::none;
  Tracker tracker(camera, options);
  REQUIRE(tracker.track(frame, std::nullopt).state == TrackingState::tracked);
  int features = 0, outside = 0;
  for (const Feature& f : tracker.map().keyframes().front().frame.features) {
    const double r = (Eigen::Vector2d(f.u, f.v) - Eigen::Vector2d(319.5, 239.5)).norm() / 400;
    ++features;
    if (r > 0.545) {
      ++outside;
      CHECK(f.depth == 0);
    }
  }
  CHECK(features > 300);
  CHECK(outside > 50);  // corners are found there, but they are nowhere
  CHECK(tracker.map().points().size() > 100);
  for (const auto& p : tracker.map().points()) {
    CHECK(p.p_w.head<2>().norm() < 0.83 * 2);
    CHECK(p.p_w.z() == doctest::Approx(2));
  }
}
