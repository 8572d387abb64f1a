// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/local_bundle.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const Pinhole<double> kCamera(525, 525, 319.5, 239.5);

SE3d small(test::Rng& rng, double translation, double rotation) {
  Eigen::Matrix<double, 6, 1> xi;
  for (int k = 0; k < 6; ++k) xi(k) = rng.normal() * (k < 3 ? translation : rotation);
  return SE3d::exp(xi);
}

struct World {
  LocalMap map;
  std::vector<SE3d> truth;
};

/// Six keyframes that see one wall of points, the later ones misplaced by centimetres.
World make_world(test::Rng& rng, int wrong_sights) {
  World w;
  std::vector<Eigen::Vector3d> points;
  for (int j = 0; j < 300; ++j)
    points.emplace_back(rng.uniform(-1, 1), rng.uniform(-0.8, 0.8), rng.uniform(2, 3));
  for (const auto& p : points) {
    MapPoint point;
    point.p_w = p + 0.02 * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal());
    (void)w.map.add_point(point);
  }
  for (int k = 0; k < 6; ++k) {
    const SE3d T = small(rng, 0.15, 0.05);
    w.truth.push_back(T);
    Frame frame;
    for (std::size_t j = 0; j < points.size(); ++j) {
      const Eigen::Vector3d p_c = T * points[j];
      const auto x = kCamera.project(p_c);
      if (!x) continue;
      Feature f;
      f.x = static_cast<float>(x->x() + 0.2 * rng.normal());
      f.y = static_cast<float>(x->y() + 0.2 * rng.normal());
      f.depth = static_cast<float>(p_c.z() + 0.01 * rng.normal());
      f.sigma = 0.3F;
      if (k == 4 && static_cast<int>(frame.features.size()) < wrong_sights) f.x += 15;
      frame.features.push_back(f);
      frame.point.push_back(static_cast<int>(j));
    }
    frame.T_c_w = k == 0 ? T : small(rng, 0.02, 0.01) * T;
    (void)w.map.add_keyframe(frame);
  }
  return w;
}

}  // namespace

TEST_CASE("the newest keyframes and their points are put right, wrong sights are forgotten") {
  test::Rng rng("local bundle");
  World w = make_world(rng, 20);
  const SE3d before = w.map.keyframes().back().frame.T_c_w;
  LocalBundle bundle(kCamera, {});
  bundle.start(w.map, DepthNoise<double>{0.004, 0.008});
  CHECK(bundle.pending());
  const SE3d D = bundle.apply(w.map);
  CHECK_FALSE(bundle.pending());
  for (std::size_t k = 0; k < w.truth.size(); ++k) {
    CAPTURE(k);
    CHECK((w.map.keyframes()[k].frame.T_c_w * w.truth[k].inverse()).translation().norm() < 0.004);
  }
  CHECK(((before * D) * w.map.keyframes().back().frame.T_c_w.inverse()).log().norm() < 1e-9);
  const auto& doubted = w.map.keyframes()[4].frame.point;
  CHECK(std::count(doubted.begin(), doubted.begin() + 20, -1) == 20);
  CHECK(std::count(doubted.begin() + 20, doubted.end(), -1) < 10);
  const auto& seen_by = w.map.points()[0].keyframes;
  CHECK(std::find(seen_by.begin(), seen_by.end(), 4) == seen_by.end());
}

TEST_CASE("what was added while the adjustment ran follows the newest adjusted keyframe") {
  test::Rng rng("local bundle meanwhile");
  World w = make_world(rng, 0);
  LocalBundle bundle(kCamera, {});
  bundle.start(w.map, DepthNoise<double>{0.004, 0.008});
  Frame later;
  later.T_c_w = SE3d(SO3d(), Eigen::Vector3d(0, 0, 0.1)) * w.map.keyframes().back().frame.T_c_w;
  MapPoint point;
  point.p_w = later.T_c_w.inverse() * Eigen::Vector3d(0, 0, 2);
  const int id = w.map.add_point(point);
  const SE3d beside = later.T_c_w * w.map.keyframes().back().frame.T_c_w.inverse();
  (void)w.map.add_keyframe(later);
  (void)bundle.apply(w.map);
  const auto& keyframes = w.map.keyframes();
  CHECK((keyframes[6].frame.T_c_w * keyframes[5].frame.T_c_w.inverse() * beside.inverse()).log().norm() <
        1e-9);
  CHECK(
      (keyframes[6].frame.T_c_w * w.map.points()[static_cast<std::size_t>(id)].p_w - Eigen::Vector3d(0, 0, 2))
          .norm() < 1e-9);
}
