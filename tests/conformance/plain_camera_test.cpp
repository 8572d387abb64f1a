// SPDX-License-Identifier: BSD-3-Clause
// What names CameraModel takes a camera that offers nothing beyond it: no derivative, no pinhole. What needs
// one of them says so in its constraint, and takes a camera that offers that alone.
#include <doctest/doctest.h>

#include <array>
#include <concepts>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/reference_keyframe.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/features/feature_placer.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/two_view.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/normals.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/map/point_maker.hpp"
#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/semantic/carried_labels.hpp"
#include "dynslam/semantic/map_scan.hpp"
#include "test_cameras.hpp"
#include "wide_fisheye.hpp"

using namespace dynslam;

namespace {

template <class C>
concept TakesTwoViews = requires(const C& camera,
                                 std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>> x) {
  two_view_geometry(camera, x, x);
};
template <class C>
concept TakesFeaturePlacer = requires {
  typename FeaturePlacer<C>;
};
template <class C>
concept TakesIdealPinhole = requires(const C& camera) {
  ideal_pinhole(camera);
};
template <class C, class S = typename C::ScalarType>
concept TakesStaticWeights = requires(const C& camera, std::span<const KeypointMatch<S>> matches,
                                      const Image<std::uint8_t>& gray, const Image<float>& depth) {
  static_weights(camera, matches, gray, gray, depth, SE3<S>());
};
template <class C>
concept TakesDepthGrid = requires(const C& camera) {
  DepthGrid(camera, 8, 8, DepthGridOptions());
};
template <class C>
concept TakesMapScanner = requires(const C& camera) {
  MapScanner<typename C::ScalarType>(camera, 8, 8);
};

template <class S>
using Plain = test::PlainPanorama<S>;

}  // namespace

TEST_CASE_TEMPLATE("what needs a derivative says so, and what does not takes a camera without", S, float,
                   double) {
  static_assert(CameraModel<Plain<S>> && !DifferentiableCamera<Plain<S>> && !HasIdealPinhole<Plain<S>>);
  static_assert(!TakesTwoViews<Plain<S>> && !TakesStaticWeights<Plain<S>> && !TakesFeaturePlacer<Plain<S>> &&
                !TakesIdealPinhole<Plain<S>> && !TakesDepthGrid<Plain<S>> && !TakesMapScanner<Plain<S>>);
  using Wide = test::WideFisheye<S>;
  static_assert(TakesTwoViews<Wide> && TakesStaticWeights<Wide> && TakesFeaturePlacer<Wide> &&
                TakesIdealPinhole<Wide> && TakesDepthGrid<Wide> && TakesMapScanner<Wide>);

  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Plain<S> camera(test::Panorama<S>(S(60), S(39.5), S(29.5)));
  const Pinhole<S> pinhole(S(60), S(60), S(39.5), S(29.5));
  const Image<float> depth(80, 60, 2.0F);
  const Image<std::uint8_t> gray(80, 60, 100), labels(80, 60, 3);
  const auto ideal = to_ideal(camera, pinhole, Vector2(S(45), S(33)));
  REQUIRE(ideal);
  const auto back = from_ideal(camera, pinhole, *ideal);
  REQUIRE(back);
  CHECK((*back - Vector2(S(45), S(33))).norm() < S(1e-3));
  CHECK(keypoint_match(camera, Vector2(S(45), S(33)), S(2), Vector2(S(45), S(33))).has_value());
  CHECK(RollingShutter<S>().project(camera, Vector3(S(0.1), S(0), S(2))).has_value());

  Image<Vector3> normals(80, 60);
  surface_normals(camera, depth, NormalOptions<S>(), normals);
  CHECK(normals(40, 30).z() < S(-0.9));
  Image<std::uint8_t> carried(80, 60, 0);
  carry_labels(camera, depth, labels, depth, SE3<S>(), carried);
  CHECK(carried(40, 30) == 3);

  HalvingPyramid<std::uint8_t> pyramid;
  pyramid.build(gray, 2);
  ReferenceKeyframe<S> reference;
  const std::vector<ReferenceKeypoint<S>> keypoints{{Vector2(S(40), S(30)), S(2)}};
  reference.set(camera, pyramid, std::span<const ReferenceKeypoint<S>>(keypoints), SE3<S>(),
                ReferenceOptions());
  CHECK(reference.size() <= 1);
  PointMaker points(camera, 80, 60);
  static_assert(std::same_as<decltype(points), PointMaker<S, Plain<S>>>);

  std::vector<Vector2> x, x_m;
  std::vector<PoseObservation<S>> observations;
  const SE3<S> T(SO3<S>(), Vector3(S(0.2), S(0), S(0)));
  for (int i = 0; i < 40; ++i) {
    const Vector3 p(S(0.1 * (i % 8) - 0.4), S(0.15 * (i / 8) - 0.3), S(2 + 0.1 * (i % 3)));
    x.push_back(*camera.project(p));
    x_m.push_back(*camera.project(T * p));
    observations.push_back({p, x_m.back(), (T * p).z(), S(1), S(100)});
  }
  using Points = std::span<const Vector2>;
  CHECK(baseline_verdict<S>(Points(x), Points(x_m), camera, SO3<S>(), S(2)) == Baseline::sufficient);
  const auto pose = absolute_pose<S>(camera, observations);
  REQUIRE(pose.ok());
  CHECK((pose.T_c_w.translation() - T.translation()).norm() < S(1e-3));
}
