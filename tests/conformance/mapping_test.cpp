// SPDX-License-Identifier: BSD-3-Clause
// From features to a map and back, with every camera: placing, matching, points, poses, windows, places,
// loops.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cameras.hpp"
#include "dynslam/dynamics/mask_arbitration.hpp"
#include "dynslam/features/descriptor.hpp"
#include "dynslam/features/feature_grid.hpp"
#include "dynslam/features/feature_placer.hpp"
#include "dynslam/features/guided_match.hpp"
#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/features/place_index.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/bundle_window.hpp"
#include "dynslam/map/covering_keyframe.hpp"
#include "dynslam/map/feature_frame.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "dynslam/map/keyframe_policy.hpp"
#include "dynslam/map/local_matcher.hpp"
#include "dynslam/map/masked_pose.hpp"
#include "dynslam/map/matched_pose.hpp"
#include "dynslam/map/point_maker.hpp"
#include "dynslam/optim/image_alignment.hpp"
#include "dynslam/optim/readout_measurement.hpp"
#include "dynslam/robust/block_jackknife.hpp"
#include "moving_scene.hpp"
#include "random.hpp"
#include "record.hpp"

using namespace dynslam;

namespace {

/// Two views of a textured wall and what the map's parts make of them.
template <class Camera>
struct Wall {
  using S = typename Camera::ScalarType;
  static constexpr std::array<float, 2> kScales{1.0F, 2.0F};
  Camera camera = test::conformance_camera<Camera>();
  std::array<HalvingPyramid<std::uint8_t>, 2> pyramids;
  std::array<Image<float>, 2> depth;
  SE3<S> T_c1_w{SO3<S>(), Eigen::Matrix<S, 3, 1>(S(-0.03), S(0), S(0))};
  KeyframeMap<S, PointPatch> map;
  LocalMatcher<Camera> matcher{camera, test::kWidth, test::kHeight, kScales};
  PointMaker<S> maker{matcher.placer().pinhole(), test::kWidth, test::kHeight};
  MatchedPose<S> pose{matcher.placer().pinhole()};

  Wall() {
    test::SceneRenderer<Camera> view(camera, test::kWidth, test::kHeight);
    test::MovingScene scene;
    for (std::size_t k = 0; k < 2; ++k) {
      view.render(scene, k == 0 ? SE3<double>() : T_c1_w.template cast<double>().inverse());
      pyramids[k].build(view.gray, 2);
      depth[k] = view.depth;
    }
  }
  [[nodiscard]] FeatureFrame<S> frame(std::size_t k) const {
    FeatureFrame<S> f;
    test::Rng rng("conformance wall");
    for (int v = 24; v < 100; v += 10) {
      for (int u = 24; u < 140; u += 10) {
        f.features.emplace_back();
        matcher.placer().place(f.features.back(), Eigen::Matrix<S, 2, 1>(S(u), S(v)), depth[k]);
        f.descriptors.emplace_back();
        for (auto& word : f.descriptors.back()) word = rng.engine()();
      }
    }
    f.point.assign(f.features.size(), -1);
    f.dynamic.assign(f.features.size(), 0);
    f.grid.build(f.features, test::kWidth, test::kHeight);
    return f;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("one view is aligned with the next by grey values behind every camera", Camera,
                   DYNSLAM_CONFORMANCE_CAMERAS) {
  using S = typename Camera::ScalarType;
  Wall<Camera> wall;
  ImageAlignmentWorkspace<S> workspace;
  const std::array<SE3<S>, 1> starts{};
  const auto found = align_images<S>(wall.pyramids[0], wall.depth[0], wall.pyramids[1], wall.camera,
                                     std::span<const SE3<S>>(starts), {}, workspace);
  REQUIRE(found.ok());
  CHECK((found.T_image_reference * wall.T_c1_w.inverse()).log().norm() < S(0.005));
}

TEST_CASE_TEMPLATE("points of one view are found in the next, with its pose, behind every camera", Camera,
                   DYNSLAM_CONFORMANCE_CAMERAS) {
  using S = typename Camera::ScalarType;
  Wall<Camera> wall;
  FeatureFrame<S> first = wall.frame(0);
  wall.maker.trust_all(first);
  const int made = wall.maker.make(wall.map, wall.pyramids[0], first);
  CHECK(made > 60);
  wall.map.add_keyframe(first);
  FeatureFrame<S> now;
  now.grid.build(now.features, test::kWidth, test::kHeight);
  wall.matcher.begin(now);
  const int found = wall.matcher.match_local(wall.map, wall.T_c1_w, wall.pyramids[1], wall.depth[1], now);
  CHECK(found > made / 3);
  wall.matcher.refine(wall.map, wall.T_c1_w, wall.pyramids[1], wall.depth[1], now);
  const auto result = wall.pose.optimize(wall.map, SE3<S>(), now);
  REQUIRE(result.ok());
  ReadoutMeasurement<S> readout;  // of a camera that moves and has a global shutter
  wall.pose.measure_readout(now, result.T_c_w, Eigen::Matrix<S, 6, 1>::Constant(S(0.5)), test::kHeight,
                            readout);
  CHECK(std::abs(readout.correction()) < S(0.02));
  CHECK(readout.sigma() < S(0.02));
  CHECK(readout.images().size() == 1);
  CHECK(readout.interval().half_width == std::numeric_limits<S>::infinity());  // of one image
  CHECK_FALSE(readout_between<S>(readout, S(0), readout, S(0.02)));            // of one time
  CHECK(block_jackknife<S>(6, [](std::size_t, std::size_t) { return S(1); }) < S(1e-6));
  CHECK((result.T_c_w * wall.T_c1_w.inverse()).log().norm() < S(0.01));
  wall.matcher.drop_unmatched(now);
  // By descriptor, from a frame that is the first one again.
  FeatureFrame<S> same = wall.frame(0);
  wall.matcher.begin(same);
  CHECK(wall.matcher.match_last(wall.map, first, SE3<S>(), 8.0F, same) > made / 2);
  wall.matcher.clear(same);
  KeyframeEvidence<S> evidence;
  evidence.inliers = evidence.points_then = made;
  evidence.frames = 1;
  KeyframeOptions<S> options;
  options.urgent = 1;
  CHECK_FALSE(wants_keyframe(evidence, options));
  std::vector<int> votes;
  CoverageOptions<S> coverage;
  coverage.min_matches = 1;
  CHECK(covering_keyframe(wall.map, first, coverage, votes) == 0);
  const auto warp = patch_warp(wall.camera, {0, 0, 2}, {S(-0.03), 0, 2}, Eigen::Matrix<S, 3, 3>::Identity());
  REQUIRE(warp.has_value());
  CHECK((*warp - Eigen::Matrix<S, 2, 2>::Identity()).norm() < S(0.05));
  // A map beside becomes part of this one.
  const auto points = wall.map.points().size();
  const Eigen::Matrix<S, 3, 1> seen = wall.map.points().front().p_w;
  CHECK(wall.map.append(wall.map, wall.T_c1_w) == 1);
  REQUIRE(wall.map.points().size() == 2 * points);
  CHECK((wall.map.point(static_cast<int>(points)).p_w - wall.T_c1_w * seen).norm() < S(1e-5));
  CHECK((wall.map.pose(1) * wall.T_c1_w).log().norm() < S(1e-5));
}

TEST_CASE_TEMPLATE("features in the pixels of every camera make points, poses and windows", Camera,
                   DYNSLAM_CONFORMANCE_CAMERAS) {
  using S = typename Camera::ScalarType;
  Wall<Camera> wall;
  PointMaker<S, Camera> maker(wall.camera, test::kWidth, test::kHeight);
  MatchedPose<S, Camera> pose(wall.camera);
  FeatureFrame<S> first = wall.frame(0);
  for (Feature& f : first.features) {
    f.x = f.u;
    f.y = f.v;
  }
  maker.trust_all(first);
  CHECK(maker.make(wall.map, wall.pyramids[0], first) > 60);
  wall.map.add_keyframe(first);
  FeatureFrame<S> second = first;
  second.T_c_w = wall.T_c1_w;
  for (std::size_t i = 0; i < second.features.size(); ++i) {
    if (second.point[i] < 0) continue;
    const Eigen::Matrix<S, 3, 1> p_c = wall.T_c1_w * wall.map.point(second.point[i]).p_w;
    const auto x = wall.camera.project(p_c);
    REQUIRE(x.has_value());
    second.features[i].x = static_cast<float>(x->x());
    second.features[i].y = static_cast<float>(x->y());
    second.features[i].depth = static_cast<float>(p_c.z());
  }
  const std::vector<std::vector<std::uint8_t>> masks{std::vector<std::uint8_t>(second.features.size(), 0)};
  MaskedPoseWorkspace masked;
  FeatureFrame<S> with_masks = second;
  const auto believed = masked_pose(
      pose, wall.map, SE3<S>(), masks, {}, with_masks, [](int) {}, masked);
  REQUIRE(believed.ok());
  CHECK(arbitrate_mask(believed.pose, believed.pose) == MaskVerdict::kept);
  const auto result = pose.optimize(wall.map, SE3<S>(), second);
  REQUIRE(result.ok());
  CHECK((believed.pose.T_c_w * result.T_c_w.inverse()).log().norm() < S(1e-6));
  CHECK((result.T_c_w * wall.T_c1_w.inverse()).log().norm() < S(1e-3));
  CHECK(pose.mean_chi2(result.T_c_w, S(25)) < S(0.1));
  second.T_c_w = SE3<S>();
  wall.map.add_keyframe(second);
  BundleWindow<S> window;
  window.collect(wall.map, DepthNoise<S>{S(0.004), S(0.008)});
  BundleWorkspace<S> workspace;
  BundleOptions<S> options;
  options.max_iterations = 20;
  const auto adjusted = bundle_adjust(wall.camera, window.problem(), options,
                                      TDistribution<S>::with_dimension(S(5), 1), workspace);
  CHECK(adjusted.ok());
  (void)window.apply(wall.camera, wall.map);
  CHECK((wall.map.pose(1) * wall.T_c1_w.inverse()).log().norm() < S(0.005));
}
