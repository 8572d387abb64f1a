// SPDX-License-Identifier: BSD-3-Clause
// Lenses of every model, and cameras whose lens has no inverse in the corners of the image.
#include <doctest/doctest.h>

#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/slam.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "office.hpp"
#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr std::size_t kLensFrames = 16;

/// Where a pinhole camera sees what another camera at the same place has in its pixels, for cv::remap.
cv::Mat map_to_pinhole(const AnyCamera<double>& lens, const Pinhole<double>& pinhole, cv::Size size) {
  cv::Mat map(size, CV_32FC2);
  for (int v = 0; v < map.rows; ++v) {
    for (int u = 0; u < map.cols; ++u) {
      const auto p = lens.unproject({double(u), double(v)}, 1.0);
      const auto x = p ? pinhole.project(*p) : std::nullopt;
      map.at<cv::Vec2f>(v, u) = x ? cv::Vec2f(float(x->x()), float(x->y())) : cv::Vec2f(-1e4F, -1e4F);
    }
  }
  return map;
}

cv::Mat remapped(const cv::Mat& image, const cv::Mat& map, int interpolation, const cv::Scalar& outside) {
  cv::Mat result;
  cv::remap(image, result, map, cv::noArray(), interpolation, cv::BORDER_CONSTANT, outside);
  return result;
}

struct LensRun {
  std::size_t tracked = 0;
  double error = 0;  ///< mean distance to the true positions, the first pose being the true one [m]
};

/// Runs the office as `recorded` sees it, with a camera that is said to be `believed`.
LensRun run_office(const AnyCamera<double>& recorded, const AnyCamera<double>& believed) {
  const auto& office = test::office();
  const Sequence sequence = load_sequence(office.sequence);
  CameraConfig camera = office.camera();
  const Pinhole<double> pinhole = camera.model.pinhole();
  REQUIRE(camera.model.is_ideal());
  CameraConfig other = camera;
  other.model = believed;
  SlamOptions options;
  options.dynamics = DynamicsMode::none;
  options.map = false;
  Slam slam(other, options);
  const cv::Mat map = map_to_pinhole(recorded, pinhole, {camera.width, camera.height});
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < kLensFrames; ++i) {
    const RgbdFrame frame = decode_frame(sequence.frames[i], i, camera);
    (void)slam.track(remapped(frame.bgr, map, cv::INTER_LINEAR, {}),
                     remapped(frame.depth, map, cv::INTER_NEAREST, cv::Scalar(kNone)), frame.t);
  }
  slam.finish();
  LensRun run;
  const auto poses = slam.trajectory();
  run.tracked = poses.size();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const SE3<double> T = sequence.groundtruth[0].T_w_c.inverse() * sequence.groundtruth[i].T_w_c;
    REQUIRE(sequence.groundtruth[i].t == doctest::Approx(poses[i].t));
    run.error += (poses[i].T_w_c.translation() - T.translation()).norm() / double(poses.size());
  }
  return run;
}

}  // namespace

TEST_CASE("a camera behind any lens is tracked as one without, if its lens is known") {
  const Pinhole<double> pinhole = test::office().camera().model.pinhole();
  const LensRun plain = run_office(pinhole, pinhole);
  CHECK(plain.tracked == kLensFrames);
  MESSAGE("no lens: " << 1e3 * plain.error << " mm");
  struct Lens {
    std::string name;
    AnyCamera<double> camera;
  };
  const PinholeBrownConrady<double> five(pinhole, BrownConrady<double>(-0.25, 0.06, 0.001, -0.002, 0));
  const PinholeBrownConrady<double> eight(pinhole,
                                          BrownConrady<double>(0.1, 0.02, 0.001, -0.001, 0, 0.4, 0.1, 0));
  const KannalaBrandt<double> fisheye(pinhole.fx(), pinhole.fy(), pinhole.cx(), pinhole.cy(),
                                      {-0.05, 0.01, -0.004, 0.0005});
  for (const Lens& lens : {Lens{"five coefficients", five}, Lens{"eight", eight}, Lens{"fisheye", fisheye}}) {
    CAPTURE(lens.name);
    const LensRun known = run_office(lens.camera, lens.camera), unknown = run_office(lens.camera, pinhole);
    MESSAGE(lens.name << ": " << 1e3 * known.error << " mm, taken for none: " << 1e3 * unknown.error
                      << " mm");
    CHECK(known.tracked == kLensFrames);
    CHECK(known.error < 2 * plain.error + 0.002);
    CHECK(unknown.error > 3 * known.error);
  }
}

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
