// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/point_maker.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "dynslam/image/image.hpp"
#include "dynslam/image/pyramid.hpp"
#include "feature_cameras.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kImageWidth = 640, kImageHeight = 480;

/// Frames that see given points, in the pixels of a camera.
template <class Camera>
struct Sights {
  using S = typename Camera::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Map = KeyframeMap<S, PointPatch>;

  Camera camera = test::feature_camera<Camera>();
  HalvingPyramid<std::uint8_t> pyramid;
  std::vector<Vector3> points;  // world

  Sights() {
    test::Rng rng("point maker");
    Image<std::uint8_t> gray(kImageWidth, kImageHeight);
    for (int v = 0; v < kImageHeight; ++v) {
      for (int u = 0; u < kImageWidth; ++u) gray(u, v) = static_cast<std::uint8_t>(rng.integer(0, 255));
    }
    pyramid.build(gray, 2);
    for (int y = -2; y <= 2; ++y) {
      for (int x = -3; x <= 3; ++x)
        points.emplace_back(S(0.35) * S(x), S(0.35) * S(y), S(3) + S(0.1) * S(rng.normal()));
    }
  }
  [[nodiscard]] FeatureFrame<S> frame(const SE3<S>& T_c_w) const {
    FeatureFrame<S> f;
    f.T_c_w = T_c_w;
    for (const Vector3& p : points) {
      const Vector3 p_c = T_c_w * p;
      const auto x = camera.project(p_c);
      REQUIRE(x.has_value());
      Feature feature;
      feature.u = feature.x = static_cast<float>(x->x());
      feature.v = feature.y = static_cast<float>(x->y());
      feature.depth = static_cast<float>(p_c.z());
      f.features.push_back(feature);
    }
    f.descriptors.resize(points.size());
    f.point.assign(points.size(), -1);
    f.dynamic.assign(points.size(), 0);
    return f;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("points stand where any camera's features show them, with a patch and a viewing direction",
                   Camera, DYNSLAM_FEATURE_CAMERAS) {
  using S = typename Camera::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Sights<Camera> sights;
  const SE3<S> T_c_w(SO3<S>::exp(Vector3(S(0.05), S(-0.1), S(0.02))), Vector3(S(0.1), S(-0.05), S(0.2)));
  typename Sights<Camera>::Map map;
  PointMaker<S, Camera> maker(sights.camera, kImageWidth, kImageHeight);
  FeatureFrame<S> frame = sights.frame(T_c_w);
  maker.trust_all(frame);
  REQUIRE(maker.make(map, sights.pyramid, frame) == static_cast<int>(sights.points.size()));
  for (std::size_t i = 0; i < sights.points.size(); ++i) {
    REQUIRE(frame.point[i] >= 0);
    const auto& point = map.point(frame.point[i]);
    CHECK((point.p_w - sights.points[i]).norm() < S(1e-4));
    CHECK(point.patch.level == 0);
    const Vector3 aside = point.viewing - (sights.points[i] - T_c_w.inverse().translation()).normalized();
    CHECK(aside.norm() < S(1e-4));
  }
}

TEST_CASE_TEMPLATE("points become the mean of what the keyframes of any camera measure", Camera,
                   DYNSLAM_FISHEYES) {
  using S = typename Camera::ScalarType;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Sights<Camera> sights;
  typename Sights<Camera>::Map map;
  PointMakerOptions<S> options;
  options.average = true;
  PointMaker<S, Camera> maker(sights.camera, kImageWidth, kImageHeight, options);
  FeatureFrame<S> first = sights.frame(SE3<S>());
  maker.trust_all(first);
  (void)maker.make(map, sights.pyramid, first);
  map.add_keyframe(first);
  const SE3<S> T_c_w(SO3<S>(), Vector3(S(-0.05), 0, 0));
  FeatureFrame<S> second = sights.frame(T_c_w);
  second.point = first.point;
  // Too far by 4 cm: the mean of two as good ones is 2 cm off along the ray, in the direction of the second.
  const Vector3 off = sights.points[0] - T_c_w.inverse().translation();
  second.features[0].depth *= 1.0F + 0.04F / static_cast<float>(off.z());
  maker.trust_all(second);
  (void)maker.make(map, sights.pyramid, second);
  const Vector3 moved = map.point(first.point[0]).p_w - sights.points[0];
  CHECK(moved.norm() == doctest::Approx(0.02 * static_cast<double>(off.norm() / off.z())).epsilon(0.05));
  CHECK(moved.normalized().dot(off.normalized()) > S(0.999));
  CHECK((map.point(first.point[7]).p_w - sights.points[7]).norm() < S(1e-4));
}

TEST_CASE_TEMPLATE("a pixel without a ray makes no point and moves none", S, float, double) {
  using Camera = test::EquidistantCamera<S>;
  const Camera narrow(S(200), S(319.5), S(239.5));  // the corners of the image lie beyond 90 degrees
  FeatureFrame<S> frame;
  frame.features.resize(2);
  frame.features[0] = {2, 2, 2, 2, 2.0F, 0, 0, 1};
  frame.features[1] = {300, 200, 300, 200, 2.0F, 0, 0, 1};
  frame.descriptors.resize(2);
  frame.point.assign(2, -1);
  frame.dynamic.assign(2, 0);
  REQUIRE_FALSE(narrow.unproject({S(2), S(2)}, S(2)).has_value());
  const Sights<Camera> sights;
  typename Sights<Camera>::Map map;
  PointMakerOptions<S> options;
  options.average = true;
  PointMaker<S, Camera> maker(narrow, kImageWidth, kImageHeight, options);
  maker.trust_all(frame);
  CHECK(maker.make(map, sights.pyramid, frame) == 1);
  CHECK(frame.point[0] == -1);
  CHECK(frame.point[1] == 0);
  map.add_keyframe(frame);
  MapPoint<S, PointPatch> matched;
  matched.p_w = {S(1), S(2), S(3)};
  frame.point[0] = map.add_point(matched);
  CHECK(maker.make(map, sights.pyramid, frame) == 2);
  CHECK(map.point(frame.point[0]).p_w == matched.p_w);
}

TEST_CASE_TEMPLATE("a feature at no pixel or without a depth moves no point", Camera,
                   DYNSLAM_FEATURE_CAMERAS) {
  using S = typename Camera::ScalarType;
  const Sights<Camera> sights;
  typename Sights<Camera>::Map map;
  PointMakerOptions<S> options;
  options.average = true;
  PointMaker<S, Camera> maker(sights.camera, kImageWidth, kImageHeight, options);
  FeatureFrame<S> frame = sights.frame(SE3<S>());
  maker.trust_all(frame);
  (void)maker.make(map, sights.pyramid, frame);
  map.add_keyframe(frame);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  FeatureFrame<S> bad = frame;
  bad.features[0].x = nan;
  bad.features[1].y = inf;
  bad.features[2].depth = nan;
  bad.features[3].depth = inf;
  maker.trust_all(bad);
  (void)maker.make(map, sights.pyramid, bad);
  map.add_keyframe(bad);
  maker.trust_all(frame);
  (void)maker.make(map, sights.pyramid, frame);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& point = map.point(frame.point[i]);
    CHECK((point.p_w - sights.points[i]).norm() < S(1e-4));
    CHECK(std::isfinite(point.information));
  }
}

TEST_CASE("the camera is deduced, and is the ideal pinhole where only the scalar is named") {
  const auto fisheye = test::feature_camera<test::EquidistantCamera<float>>();
  CHECK(std::is_same_v<decltype(PointMaker(fisheye, kImageWidth, kImageHeight)),
                       PointMaker<float, test::EquidistantCamera<float>>>);
  CHECK(std::is_same_v<decltype(PointMaker(fisheye, kImageWidth, kImageHeight, PointMakerOptions<float>{})),
                       PointMaker<float, test::EquidistantCamera<float>>>);
  CHECK(std::is_same_v<PointMaker<double>, PointMaker<double, Pinhole<double>>>);
}
