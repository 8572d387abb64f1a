// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/frame_revision.hpp"

#include <doctest/doctest.h>

#include <array>
#include <utility>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr double kReadout = 0.03, kInterval = 0.1;
constexpr std::array<float, 1> kScale{1.0F};

/// A camera that turns faster and faster, and a frame of it whose rows were placed by how it turned before.
template <class S>
struct Turning {
  using Vector6 = typename SE3<S>::Vector6;
  Pinhole<S> camera{S(525), S(525), S(319.5), S(239.5)};
  PoseTrackingOptions<S> options;
  LocalMapPose<Pinhole<S>> solver{camera, kWidth, kHeight, kScale, {}, {}, options};
  LastFrame<S> last;
  KeyframeMap<S, PointPatch> map;
  Image<float> depth{kWidth, kHeight, 1.0F};
  SE3<S> truth, next;  // T_c_w of the last frame and the one at hand

  explicit Turning(double readout_time = kReadout) : last(options, readout_time, kHeight) {
    const Vector6 before = (Vector6() << S(0), S(0), S(0), S(0), S(0.04), S(0.02)).finished();
    const Vector6 after = S(2) * before;  // between frames
    truth = SE3<S>::exp(before);
    next = SE3<S>::exp(after) * truth;
    const RollingShutter<S> own(S(1.5) * before * S(kReadout / kInterval), kHeight),
        assumed(before * S(kReadout / kInterval), kHeight);
    test::Rng rng("turning");
    FeatureFrame<S> frame;
    while (frame.features.size() < 200) {
      const Eigen::Matrix<S, 2, 1> x(S(rng.uniform(20, 620)), S(rng.uniform(20, 460)));
      const S z = S(rng.uniform(1, 4));
      const Eigen::Matrix<S, 3, 1> p_c = camera.ray(x) * z;
      const auto recorded = own.project(camera, p_c);
      if (!recorded) continue;
      MapPoint<S, PointPatch> point;
      point.p_w = truth.inverse() * p_c;
      point.keyframes = {0};
      Feature f;
      f.u = f.x = static_cast<float>(recorded->x());
      f.v = f.y = static_cast<float>(recorded->y());
      f.depth = static_cast<float>(own.to_row(p_c, recorded->y()).z());
      solver.placer().set_rolling_shutter(assumed);
      solver.placer().bring_to_middle(f);
      frame.features.push_back(f);
      frame.point.push_back(map.add_point(point));
      frame.descriptors.emplace_back();
    }
    frame.dynamic.assign(frame.features.size(), 0);
    FeatureFrame<S> first;
    first.features.resize(1);
    last.replace(std::move(first), {0}, {}, 0, {});
    frame.t = kInterval;
    frame.T_c_w = solver.optimiser().optimize(map, truth, frame).T_c_w;
    map.add_keyframe(frame);
    last.accept(frame.T_c_w, frame.t);
    last.set_velocity(SE3<S>::exp(before), kInterval);
    last.replace(std::move(frame), {kInterval, 0, 7}, assumed, 0, 0);
  }
  std::optional<PoseResult<S>> revise(const PoseTrackingOptions<S>& by) {
    FrameRevision<Pinhole<S>> revision(by);
    return revision.revise(map, last, 2 * kInterval, next, solver);
  }
  [[nodiscard]] S error() const { return (last.frame().T_c_w * truth.inverse()).log().norm(); }
};

}  // namespace

TEST_CASE_TEMPLATE("the motion that leads on places the last frame's rows, and moves its keyframe along", S,
                   float, double) {
  Turning<S> camera;
  const S before = camera.error();
  CHECK(before > S(1e-4));
  const auto pose = camera.revise(camera.options);
  REQUIRE(pose);
  CHECK(camera.error() < S(0.3) * before);
  const FeatureFrame<S>& kept = camera.map.keyframe(0).frame;
  CHECK((kept.T_c_w * camera.last.frame().T_c_w.inverse()).log().norm() < S(1e-7));
  // A point that it alone has seen is where its feature shows it now.
  for (std::size_t i = 0; i < kept.features.size(); i += 20) {
    if (kept.point[i] < 0) continue;
    const auto p_c = kept.T_c_w * camera.map.point(kept.point[i]).p_w;
    CHECK((p_c - camera.solver.placer().point(kept.features[i])).norm() < S(1e-4));
  }
}

TEST_CASE("a keyframe that is released stays where it was") {
  Turning<double> camera;
  const SE3<double> before = camera.map.keyframe(0).frame.T_c_w;
  camera.last.release_keyframe();
  CHECK(camera.revise(camera.options));
  CHECK((camera.map.keyframe(0).frame.T_c_w * before.inverse()).log().norm() < 1e-15);
}

TEST_CASE(
    "nothing is revised where all rows are read at once, or it is not wanted, or the readout is measured") {
  CHECK_FALSE(Turning<double>(0).revise({}));
  PoseTrackingOptions<double> off;
  off.revise = false;
  CHECK_FALSE(Turning<double>().revise(off));
  Turning<double> measured;
  measured.solver.measure_readout();
  CHECK_FALSE(measured.revise({}));
  Turning<double> lost;
  lost.last.lose();
  CHECK_FALSE(lost.revise({}));
}
