// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/masked_pose.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// 200 points before a camera, matched; those of u < `split` lie on what a mask calls a mover.
template <class S>
struct Scene {
  Pinhole<S> camera{S(500), S(500), S(320), S(240)};
  KeyframeMap<S> map;
  FeatureFrame<S> frame;
  SE3<S> truth = SE3<S>::exp(
      (Eigen::Matrix<S, 6, 1>() << S(0.2), S(-0.1), S(0.1), S(0.05), S(-0.1), S(0.03)).finished());
  std::vector<std::uint8_t> left_rim, left_half, all_but_few, all;
  MatchedPose<S> pose{camera};
  MaskedPoseWorkspace workspace;
  std::vector<int> forgotten;

  /// @param mover_px  how far what lies on the left has gone since the map was made
  /// @param frames    for which the points have been in view
  explicit Scene(double mover_px, int frames = 20) {
    test::Rng rng("masked pose");
    for (int k = 0; k < 200; ++k) {
      const Eigen::Matrix<S, 2, 1> x(S(rng.uniform(20, 620)), S(rng.uniform(20, 460)));
      const S z = S(rng.uniform(1, 4));
      MapPoint<S> point;
      point.p_w = truth.inverse() * (camera.ray(x) * z);
      point.visible = frames;
      Feature f;
      f.x = f.u = static_cast<float>(x.x()) + static_cast<float>(0.3 * rng.normal());
      f.y = f.v = static_cast<float>(x.y()) + static_cast<float>(0.3 * rng.normal());
      if (x.x() < S(320)) f.x += static_cast<float>(mover_px);
      f.depth = static_cast<float>(z);
      frame.features.push_back(f);
      frame.point.push_back(map.add_point(point));
      left_rim.push_back(x.x() < S(100) ? 1 : 0);
      left_half.push_back(x.x() < S(320) ? 1 : 0);
      all_but_few.push_back(x.x() < S(500) || x.y() < S(100) ? 1 : 0);
      all.push_back(1);
    }
    frame.dynamic.assign(frame.features.size(), 0);
  }
  MaskedPoseResult<S> find(const std::vector<std::vector<std::uint8_t>>& masks) {
    return masked_pose(
        pose, map, truth, masks, {}, frame, [&](int id) { forgotten.push_back(id); }, workspace);
  }
  [[nodiscard]] int matches() const {
    int n = 0;
    for (const int p : frame.point) n += p >= 0 ? 1 : 0;
    return n;
  }
  [[nodiscard]] S error(const SE3<S>& T) const { return (T * truth.inverse()).log().norm(); }
};

}  // namespace

TEST_CASE_TEMPLATE("a mask that leaves a sharp pose is believed, and its matches are gone", S, float,
                   double) {
  Scene<S> scene(3.0);
  const auto result = scene.find({scene.left_half});
  CHECK(result.verdict == MaskVerdict::kept);
  CHECK(result.mask == 0);
  CHECK(scene.frame.dynamic == scene.left_half);
  CHECK(scene.error(result.pose.T_c_w) < S(0.003));
  for (std::size_t i = 0; i < scene.frame.point.size(); ++i) {
    if (scene.left_half[i] != 0) CHECK(scene.frame.point[i] < 0);
  }
  CHECK(scene.forgotten.size() > 60);
}

TEST_CASE_TEMPLATE("a mask over what stands still is not believed where it costs the pose", S, float,
                   double) {
  Scene<S> scene(0);
  const auto result = scene.find({scene.all_but_few});
  CHECK(result.verdict == MaskVerdict::one_motion);
  CHECK(result.mask == 1);
  CHECK(scene.matches() > 150);
  CHECK(scene.forgotten.empty());
  for (const auto flag : scene.frame.dynamic) CHECK(flag == 0);
}

TEST_CASE_TEMPLATE("points that were made a moment ago drop no mask: they are where they are seen", S, float,
                   double) {
  Scene<S> scene(0, MaskArbitrationOptions<S>{}.young - 1);
  const auto result = scene.find({scene.all_but_few});
  CHECK(result.verdict == MaskVerdict::kept);
  CHECK(result.mask == 0);
  CHECK(scene.frame.dynamic == scene.all_but_few);
}

TEST_CASE_TEMPLATE("a mask over what moves is believed even where it leaves little", S, float, double) {
  Scene<S> scene(3.0);
  // Whatever is not on the right goes: what is left is all that stands still, less a strip of it.
  std::vector<std::uint8_t> mask = scene.left_half;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (scene.frame.features[i].y < 240) mask[i] = 1;
  }
  const auto result = scene.find({mask});
  CHECK(result.verdict == MaskVerdict::kept);
  CHECK(scene.error(result.pose.T_c_w) < S(0.01));
}

TEST_CASE_TEMPLATE("where a mask leaves nothing the next one is asked, and at last none", S, float, double) {
  Scene<S> scene(0);
  const auto result = scene.find({scene.all, scene.left_rim});
  CHECK(result.verdict == MaskVerdict::starved);
  CHECK(result.mask == 1);
  CHECK(scene.frame.dynamic == scene.left_rim);
  Scene<S> nothing_left(0);
  CHECK(nothing_left.find({nothing_left.all}).mask == 1);
  CHECK(nothing_left.matches() > 180);
  Scene<S> no_mask(0);
  const auto alone = no_mask.find({});
  CHECK(alone.verdict == MaskVerdict::kept);
  CHECK(alone.pose.inliers > 180);
}
