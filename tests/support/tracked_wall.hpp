// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "dynslam/features/place_index.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/track/keyframe_inserter.hpp"
#include "dynslam/track/pose_search.hpp"
#include "moving_scene.hpp"
#include "random.hpp"

namespace dynslam::test {

/// A camera that moves to the right before a textured wall with two boards, 3 cm from one view to the next,
/// and what the parts of a tracker share: the map, the last frame, and what optimises poses.
/// @tparam Camera  of 160 x 120 pixels
template <class Camera>
struct TrackedWall {
  using S = typename Camera::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Map = KeyframeMap<S, PointPatch>;
  using Pyramid = HalvingPyramid<std::uint8_t>;
  using Evidence = PoseEvidence<Map, Pyramid, Image<float>>;
  static constexpr int kWidth = 160, kHeight = 120;
  static constexpr double kStep = 0.03, kInterval = 1.0 / 30;  // [m], [s]
  static constexpr std::array<float, 2> kScales{1.0F, 2.0F};

  struct View {
    SE3<S> T_c_w;
    FrameTime time;
    Pyramid pyramid;
    Image<float> depth;
  };

  Camera camera;
  PoseTrackingOptions<S> options;
  LocalMapPose<Camera> solver;
  LastFrame<S> last;
  Map map;
  PlaceIndex places;
  KeyframeInserter<Camera> inserter;
  SceneRenderer<Camera> renderer;
  std::vector<Vector3> points;  // of the corners, in the world of the first view
  std::vector<Descriptor> looks;

  explicit TrackedWall(const Camera& of, const PoseTrackingOptions<S>& search = {})
      : camera(of),
        options(search),
        solver(of, kWidth, kHeight, kScales, {}, {}, search),
        last(search, 0, kHeight),
        inserter(ideal_pinhole(of), of, kWidth, kHeight),
        renderer(of, kWidth, kHeight) {
    Rng rng("tracked wall");
    const View first = view(0);
    for (int v = 16; v < kHeight - 12; v += 8) {
      for (int u = 16; u < kWidth - 12; u += 8) {
        const auto p = camera.unproject(Eigen::Matrix<S, 2, 1>(S(u), S(v)), S(first.depth(u, v)));
        if (!p) continue;
        points.push_back(*p);
        looks.emplace_back();
        for (auto& word : looks.back()) word = rng.engine()();
      }
    }
  }

  [[nodiscard]] View view(int k) {
    View result;
    result.T_c_w = SE3<S>(SO3<S>(), Vector3(S(-kStep * k), S(0), S(0)));
    result.time.t = 1 + kInterval * k;
    result.time.ns = 100 + k;
    renderer.render(MovingScene(), result.T_c_w.template cast<double>().inverse());
    result.pyramid.build(renderer.gray, 2);
    result.depth = renderer.depth;
    return result;
  }

  [[nodiscard]] Evidence evidence(const View& v) { return {map, last, v.pyramid, v.depth, v.time}; }

  /// The corners that a view shows, and no matches.
  template <class Estimate>
  void see(const View& v, Estimate& now) {
    FeatureFrame<S>& frame = now.frame;
    frame.t = v.time.t;
    frame.index = static_cast<std::size_t>(v.time.ns - 100);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto x = camera.project(v.T_c_w * points[i]);
      if (!x || x->x() < 4 || x->y() < 4 || x->x() > kWidth - 5 || x->y() > kHeight - 5) continue;
      Feature f;
      f.u = static_cast<float>(x->x());
      f.v = static_cast<float>(x->y());
      frame.features.push_back(f);
      frame.descriptors.push_back(looks[i]);
    }
    solver.begin(evidence(v), now);
  }

  /// Makes the first view the first keyframe, and tracks the second.
  void start() {
    PoseEstimate<S> first;
    const View at_first = view(0);
    see(at_first, first);
    const auto trust = [](auto& maker, const FeatureFrame<S>& frame) { maker.trust_all(frame); };
    const auto inserted =
        inserter.insert(map, places, at_first.pyramid, at_first.depth, 0, trust, first.frame);
    REQUIRE(inserted.keyframe == 0);
    last.replace(std::move(first.frame), at_first.time, {}, 0, inserted.keyframe);
    track(1);
  }
  /// Tracks a view from its true pose.
  void track(int k) {
    const View v = view(k);
    PoseEstimate<S> now;
    see(v, now);
    now.frame.T_c_w = v.T_c_w;
    REQUIRE(solver.prove(evidence(v), options.min_inliers, true, now));
    solver.matcher().drop_unmatched(now.frame);
    last.accept(now.frame.T_c_w, v.time.t);
    last.replace(std::move(now.frame), v.time, {}, map.newest(), {});
  }

  [[nodiscard]] static S error(const SE3<S>& T_c_w, const View& v) {
    return (T_c_w * v.T_c_w.inverse()).log().norm();
  }
};

}  // namespace dynslam::test
