// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/bundle_window.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "feature_cameras.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
SE3<S> small(test::Rng& rng, double translation, double rotation) {
  Eigen::Matrix<S, 6, 1> xi;
  for (int k = 0; k < 6; ++k) xi(k) = S(rng.normal() * (k < 3 ? translation : rotation));
  return SE3<S>::exp(xi);
}

template <class S, class Camera = Pinhole<S>>
struct World {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  Camera camera = test::feature_camera<Camera>();
  DepthNoise<S> noise{S(0.004), S(0.008)};
  KeyframeMap<S> map;
  std::vector<SE3<S>> truth;

  /// Six keyframes that see one wall of points, the later ones misplaced by centimetres.
  World(test::Rng& rng, int wrong_sights) {
    std::vector<Vector3> points;
    for (int j = 0; j < 300; ++j)
      points.emplace_back(S(rng.uniform(-1, 1)), S(rng.uniform(-0.8, 0.8)), S(rng.uniform(2, 3)));
    for (const auto& p : points) {
      MapPoint<S> point;
      point.p_w = p + S(0.02) * Vector3(S(rng.normal()), S(rng.normal()), S(rng.normal()));
      (void)map.add_point(point);
    }
    for (int k = 0; k < 6; ++k) {
      const SE3<S> T = small<S>(rng, 0.15, 0.05);
      truth.push_back(T);
      FeatureFrame<S> frame;
      for (std::size_t j = 0; j < points.size(); ++j) {
        const Vector3 p_c = T * points[j];
        const auto x = camera.project(p_c);
        if (!x) continue;
        Feature f;
        f.x = static_cast<float>(x->x() + S(0.2 * rng.normal()));
        f.y = static_cast<float>(x->y() + S(0.2 * rng.normal()));
        f.depth = static_cast<float>(p_c.z() + S(0.01 * rng.normal()));
        f.sigma = 0.3F;
        if (k == 4 && static_cast<int>(frame.features.size()) < wrong_sights) f.x += 15;
        frame.features.push_back(f);
        frame.point.push_back(static_cast<int>(j));
      }
      frame.T_c_w = k == 0 ? T : small<S>(rng, 0.02, 0.01) * T;
      (void)map.add_keyframe(frame);
    }
  }

  BundleResult<S> adjust(BundleWindow<S>& window) {
    BundleWorkspace<S> workspace;
    return bundle_adjust<S>(camera, window.problem(), BundleOptions<S>{},
                            TDistribution<S>::with_dimension(S(5), 1), workspace);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("the newest keyframes and their points are put right, wrong sights are forgotten", S,
                   float, double) {
  test::Rng rng("local bundle");
  World<S> w(rng, 20);
  const SE3<S> before = w.map.keyframes().back().frame.T_c_w;
  BundleWindow<S> window;
  window.collect(w.map, w.noise);
  REQUIRE(w.adjust(window).ok());
  const SE3<S> D = window.apply(w.camera, w.map);
  for (std::size_t k = 0; k < w.truth.size(); ++k) {
    CAPTURE(k);
    CHECK((w.map.keyframes()[k].frame.T_c_w * w.truth[k].inverse()).translation().norm() < S(0.004));
  }
  const S tolerance = std::is_same_v<S, float> ? S(1e-5) : S(1e-9);
  CHECK(((before * D) * w.map.keyframes().back().frame.T_c_w.inverse()).log().norm() < tolerance);
  const auto& doubted = w.map.keyframes()[4].frame.point;
  CHECK(std::count(doubted.begin(), doubted.begin() + 20, -1) == 20);
  CHECK(std::count(doubted.begin() + 20, doubted.end(), -1) < 10);
  const auto& seen_by = w.map.points()[0].keyframes;
  CHECK(std::find(seen_by.begin(), seen_by.end(), 4) == seen_by.end());
}

TEST_CASE_TEMPLATE("a window of features in the pixels of any camera is put right alike", Camera,
                   DYNSLAM_FISHEYES) {
  using S = typename Camera::ScalarType;
  test::Rng rng("local bundle of a fisheye");
  World<S, Camera> w(rng, 20);
  BundleWindow<S> window;
  window.collect(w.map, w.noise);
  REQUIRE(w.adjust(window).ok());
  (void)window.apply(w.camera, w.map);
  for (std::size_t k = 0; k < w.truth.size(); ++k) {
    CAPTURE(k);
    CHECK((w.map.keyframes()[k].frame.T_c_w * w.truth[k].inverse()).translation().norm() < S(0.004));
  }
  const auto& doubted = w.map.keyframes()[4].frame.point;
  CHECK(std::count(doubted.begin(), doubted.begin() + 20, -1) == 20);
  CHECK(std::count(doubted.begin() + 20, doubted.end(), -1) < 10);
}

TEST_CASE_TEMPLATE("sights behind their camera do not stay in the map, and hide no others", S, float,
                   double) {
  test::Rng rng("local bundle behind");
  World<S> w(rng, 0);
  const std::size_t before = w.map.keyframes()[5].frame.point.size();
  MapPoint<S> point;  // half of the keyframes are said to see what is behind all of them
  point.p_w = {S(0.1), S(0.2), S(-2)};
  const int id = w.map.add_point(point);
  for (int k = 3; k < 6; ++k) {
    FeatureFrame<S>& frame = w.map.keyframe(k).frame;
    Feature f;
    f.x = 300;
    f.y = 200;
    f.sigma = 0.3F;
    frame.features.push_back(f);
    frame.point.push_back(-1);
    w.map.observe(k, static_cast<int>(before), id);
  }
  BundleWindowOptions<S> options;
  options.outlier_chi2 = std::numeric_limits<S>::infinity();  // no bound keeps them
  BundleWindow<S> window(options);
  window.collect(w.map, w.noise);
  REQUIRE(w.adjust(window).ok());
  (void)window.apply(w.camera, w.map);
  for (int k = 3; k < 6; ++k) CHECK(w.map.keyframe(k).frame.point.back() == -1);
  CHECK(w.map.point(id).keyframes.empty());
  CHECK(w.map.point(id).bad);
  for (std::size_t k = 0; k < w.truth.size(); ++k) {
    const auto& seen = w.map.keyframes()[k].frame.point;
    CHECK(std::count(seen.begin(), seen.begin() + static_cast<std::ptrdiff_t>(before), -1) == 0);
    CHECK((w.map.keyframes()[k].frame.T_c_w * w.truth[k].inverse()).translation().norm() < S(0.004));
  }
}

TEST_CASE_TEMPLATE("what was added meanwhile follows the newest adjusted keyframe", S, float, double) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("local bundle meanwhile");
  World<S> w(rng, 0);
  BundleWindow<S> window;
  window.collect(w.map, w.noise);
  REQUIRE(w.adjust(window).ok());
  FeatureFrame<S> later;
  later.T_c_w = SE3<S>(SO3<S>(), Vector3(0, 0, S(0.1))) * w.map.keyframes().back().frame.T_c_w;
  MapPoint<S> point;
  point.p_w = later.T_c_w.inverse() * Vector3(0, 0, 2);
  const int id = w.map.add_point(point);
  const SE3<S> beside = later.T_c_w * w.map.keyframes().back().frame.T_c_w.inverse();
  (void)w.map.add_keyframe(later);
  (void)window.apply(w.camera, w.map);
  const auto& keyframes = w.map.keyframes();
  const S tolerance = std::is_same_v<S, float> ? S(1e-5) : S(1e-9);
  CHECK((keyframes[6].frame.T_c_w * keyframes[5].frame.T_c_w.inverse() * beside.inverse()).log().norm() <
        tolerance);
  CHECK((keyframes[6].frame.T_c_w * w.map.point(id).p_w - Vector3(0, 0, 2)).norm() < tolerance);
}

TEST_CASE_TEMPLATE(
    "the window is the newest keyframe and its nearest, held by those that see the same points", S, float,
    double) {
  KeyframeMap<S> map;
  for (int p = 0; p < 100; ++p) (void)map.add_point({});
  for (int k = 0; k < 10; ++k) {  // each shares 23 of 30 points with its neighbours, 16 with theirs
    FeatureFrame<S> frame;
    for (int p = 7 * k; p < 7 * k + 30; ++p) frame.point.push_back(p);
    frame.features.resize(frame.point.size());
    frame.T_c_w = SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(S(k), 0, 0));
    (void)map.add_keyframe(frame);
  }
  BundleWindowOptions<S> options;
  options.window = 3;
  options.fixed = 2;
  BundleWindow<S> window(options);
  const auto x = [](const SE3<S>& T) { return static_cast<int>(std::lround(T.translation().x())); };
  window.collect(map, DepthNoise<S>{});
  BundleProblem<S> problem = window.problem();
  REQUIRE(problem.poses.size() == 5);
  const std::vector<int> expected{8, 7, 9, 6, 5}, fixed{0, 0, 0, 1, 1};
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(x(problem.poses[i]) == expected[i]);
    CHECK(problem.fixed[i] == fixed[i]);
  }
  // Points of the window that two of the five see.
  CHECK(problem.points.size() == 93 - 49 - 7);
  CHECK(std::is_sorted(problem.observations.begin(), problem.observations.end(),
                       [](const auto& a, const auto& b) { return a.point < b.point; }));
  // Where nobody is left to hold the window, one of it does.
  options.fixed = 0;
  BundleWindow<S> alone(options);
  alone.collect(map, DepthNoise<S>{}, 100);
  problem = alone.problem();
  CHECK(problem.poses.size() == 5);  // who shares a point with the newest
  CHECK(std::count(problem.fixed.begin(), problem.fixed.end(), 1) == 1);
  KeyframeMap<S> none;
  window.collect(none, DepthNoise<S>{});
  CHECK(window.problem().poses.empty());
  CHECK(window.problem().observations.empty());
}

TEST_CASE_TEMPLATE("sights of a point behind the camera are forgotten and spoil nothing else", S, float,
                   double) {
  test::Rng rng("local bundle behind");
  World<S> w(rng, 0);
  MapPoint<S> behind;
  behind.p_w = {S(0.1), S(0.2), S(-2)};
  const int id = w.map.add_point(behind);
  for (const int k : {2, 3, 5}) {  // wrong matches with it
    auto& frame = w.map.keyframe(k).frame;
    Feature f;
    f.x = 300;
    f.y = 200;
    f.depth = 2;
    frame.features.push_back(f);
    frame.point.push_back(-1);
    w.map.observe(k, static_cast<int>(frame.point.size()) - 1, id);
  }
  BundleWindow<S> window;
  window.collect(w.map, w.noise);
  REQUIRE(w.adjust(window).ok());
  (void)window.apply(w.camera, w.map);
  CHECK(w.map.point(id).bad);
  CHECK(w.map.point(id).keyframes.empty());
  for (std::size_t k = 0; k < w.truth.size(); ++k) {
    CHECK((w.map.keyframes()[k].frame.T_c_w * w.truth[k].inverse()).translation().norm() < S(0.004));
    for (int p = 0; p < 300; ++p) CHECK((w.map.keyframes()[k].frame.T_c_w * w.map.point(p).p_w).z() > S(0));
  }
}
