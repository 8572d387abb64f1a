// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/matched_pose.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "feature_cameras.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A map of points before a camera, and a frame that sees each of them, the pose being known.
template <class Camera>
struct Sight {
  using S = typename Camera::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  Camera camera = test::feature_camera<Camera>();
  KeyframeMap<S> map;
  FeatureFrame<S> frame;
  SE3<S> truth = SE3<S>::exp(
      (Eigen::Matrix<S, 6, 1>() << S(0.2), S(-0.1), S(0.1), S(0.05), S(-0.1), S(0.03)).finished());

  explicit Sight(double noise_px = 0) {
    test::Rng rng("matched pose");
    for (int k = 0; k < 150; ++k) {
      const Vector3 p_c(S(rng.uniform(-1.2, 1.2)), S(rng.uniform(-0.9, 0.9)), S(rng.uniform(2, 4)));
      const auto x = camera.project(p_c);
      if (!x) continue;
      MapPoint<S> point;
      point.p_w = truth.inverse() * p_c;
      Feature f;
      f.x = static_cast<float>(x->x() + S(noise_px * rng.normal()));
      f.y = static_cast<float>(x->y() + S(noise_px * rng.normal()));
      f.depth = static_cast<float>(p_c.z());
      frame.features.push_back(f);
      frame.point.push_back(map.add_point(point));
    }
    frame.dynamic.assign(frame.features.size(), 0);
  }
  [[nodiscard]] SE3<S> start() const {
    return SE3<S>::exp((Eigen::Matrix<S, 6, 1>() << S(0.02), S(-0.01), S(0.015), S(0.01), S(0.01), S(-0.01))
                           .finished()) *
           truth;
  }
  [[nodiscard]] S error(const SE3<S>& T) const { return (T * truth.inverse()).log().norm(); }
};

}  // namespace

TEST_CASE_TEMPLATE("matches in the pixels of any camera tell its pose, and wrong ones are dropped", Camera,
                   DYNSLAM_FEATURE_CAMERAS) {
  using S = typename Camera::ScalarType;
  Sight<Camera> sight;
  for (std::size_t i = 0; i < 10; ++i) sight.frame.features[i].x += 12;  // corners that look alike
  MatchedPose<S, Camera> pose(sight.camera);
  const auto result = pose.optimize(sight.map, sight.start(), sight.frame);
  REQUIRE(result.ok());
  CHECK(sight.error(result.T_c_w) < S(1e-4));
  CHECK(result.inliers == static_cast<int>(sight.frame.features.size()) - 10);
  for (std::size_t i = 0; i < sight.frame.point.size(); ++i) CHECK((sight.frame.point[i] < 0) == (i < 10));
}

TEST_CASE_TEMPLATE("a mover before any camera loses its matches to the consensus, whatever it weighs", Camera,
                   DYNSLAM_FEATURE_CAMERAS) {
  using S = typename Camera::ScalarType;
  Sight<Camera> sight(0.2);
  const std::size_t mover = sight.frame.features.size() / 3;
  for (std::size_t i = 0; i < mover; ++i) sight.frame.features[i].y += 9;
  sight.frame.dynamic[mover] = 1;  // flagged, so not asked
  MatchedPose<S, Camera> pose(sight.camera);
  pose.gather(sight.map, sight.frame);
  PoseConsensusOptions<S> options;
  const std::array<SE3<S>, 1> alternatives{SE3<S>()};
  const Eigen::Vector2i size(640, 480);
  const std::array<const Eigen::Vector2i*, 2> weighting{nullptr, &size};
  for (const Eigen::Vector2i* weigh_in : weighting) {
    const SE3<S> T = pose.consensus(sight.start(), alternatives, options, weigh_in);
    CHECK(sight.error(T) < S(0.01));
    // A third of the matches is off and counts as 25 each; the others hardly count.
    const S off = S(25) * S(mover) / S(sight.frame.features.size() - 1);
    CHECK(std::abs(pose.mean_chi2(T, S(25)) - off) < S(0.2));
    CHECK(pose.mean_chi2(sight.start(), S(25)) > pose.mean_chi2(T, S(25)));
    FeatureFrame<S> frame = sight.frame;
    pose.keep_consistent(T, S(25), frame);
    for (std::size_t i = 0; i < frame.point.size(); ++i) CHECK((frame.point[i] < 0) == (i < mover));
  }
}

TEST_CASE("the camera is deduced, and is the ideal pinhole where only the scalar is named") {
  const auto fisheye = test::feature_camera<test::EquidistantCamera<float>>();
  CHECK(std::is_same_v<decltype(MatchedPose(fisheye)), MatchedPose<float, test::EquidistantCamera<float>>>);
  CHECK(std::is_same_v<decltype(MatchedPose(fisheye, MatchedPoseOptions<float>{})),
                       MatchedPose<float, test::EquidistantCamera<float>>>);
  CHECK(std::is_same_v<MatchedPose<double>, MatchedPose<double, Pinhole<double>>>);
}
