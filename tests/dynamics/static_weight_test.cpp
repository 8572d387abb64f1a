// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/static_weight.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "dynslam/dynamics/classify.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A textured wall at z = 2 m in the reference frame, seen by a camera that moved sideways.
template <class S>
struct Wall {
  Pinhole<S> camera{S(200), S(200), S(80), S(60)};
  SE3<S> T_cur_ref{SO3<S>(), Eigen::Matrix<S, 3, 1>(S(-0.1), S(0), S(0))};
  Image<S> reference{160, 120}, current{160, 120}, depth{160, 120, S(2)};
  Wall() {
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        reference(u, v) = texture(S(u), S(v));
        current(u, v) = texture(S(u) + S(10), S(v));  // 0.1 m * 200 px / 2 m
      }
    }
  }
  static S texture(S u, S v) { return S(100) + S(40) * std::sin(S(0.2) * u) * std::cos(S(0.15) * v); }
};

}  // namespace

TEST_CASE_TEMPLATE("a static point has no errors, a moved one has (Eqs 3, 5, 6)", S, float, double) {
  const Wall<S> wall;
  const Eigen::Matrix<S, 2, 1> x(S(90), S(50));
  const Eigen::Matrix<S, 3, 1> p_c = wall.T_cur_ref * *wall.camera.unproject(x, S(2));
  const Eigen::Matrix<S, 2, 1> projected = *wall.camera.project(p_c);
  CHECK(std::abs(*photometric_residual(wall.reference, x, wall.current, projected)) < S(0.01));
  CHECK(reprojection_residual(projected, projected) == S(0));
  CHECK(std::abs(*depth_residual(p_c, wall.depth, projected)) < S(1e-5));
  const Eigen::Matrix<S, 2, 1> match = projected + Eigen::Matrix<S, 2, 1>(S(6), S(0));
  CHECK(reprojection_residual(projected, match) == doctest::Approx(6.0));
  CHECK(*depth_residual(Eigen::Matrix<S, 3, 1>(p_c + Eigen::Matrix<S, 3, 1>(S(0), S(0), S(0.3))), wall.depth,
                        match) == doctest::Approx(0.3).epsilon(1e-4));
  CHECK_FALSE(depth_residual(p_c, wall.depth, Eigen::Matrix<S, 2, 1>(S(-3), S(10))));
  Image<S> hole(160, 120, std::numeric_limits<S>::quiet_NaN());
  CHECK_FALSE(depth_residual(p_c, hole, projected));
  CHECK_FALSE(photometric_residual(wall.reference, x, wall.current, Eigen::Matrix<S, 2, 1>(S(1000), S(0))));
}

TEST_CASE_TEMPLATE("Eq (7): the joint weight, with errors that are missing", S, float, double) {
  const StaticWeightScales<S> scales{S(5), S(1), S(0.02)};
  // Fault: an error that was given did not count unless a flag beside it was set.
  KeypointResiduals<S> e{S(10), S(2), S(0.06)};
  CHECK(e.dimension() == 3);
  CHECK(squared_normalised(e, scales) == doctest::Approx(4.0 + 4.0 + 9.0));
  CHECK(static_weight(e, scales, S(5)) == doctest::Approx(8.0 / 22.0));
  CHECK(static_weight(e, scales, TDistribution<S>::paper()) == doctest::Approx(12.0 / 28.0));  // as printed
  e.depth.reset();
  CHECK(static_weight(e, scales, S(5)) == doctest::Approx(7.0 / 13.0));
  e.photometric.reset();
  CHECK(static_weight(e, scales, S(5)) == doctest::Approx(6.0 / 9.0));
}

TEST_CASE("tau separates moving from static keypoints") {
  test::Rng rng("separation");
  const StaticWeightScales<double> scales{5, 1, 0.02};
  int static_kept = 0, moving_found = 0;
  constexpr int kPoints = 2000;
  for (int i = 0; i < kPoints; ++i) {
    KeypointResiduals<double> e{5 * rng.normal(), std::hypot(rng.normal(), rng.normal()) / std::sqrt(2.0),
                                0.02 * rng.normal()};
    static_kept += is_dynamic(static_weight(e, scales, 5.0), 0.25) ? 0 : 1;
    e.reprojection += rng.uniform(5, 30);
    *e.depth += rng.uniform(0.03, 0.3);
    moving_found += is_dynamic(static_weight(e, scales, 5.0), 0.25) ? 1 : 0;
  }
  CHECK(static_kept > kPoints * 99 / 100);
  CHECK(moving_found > kPoints * 97 / 100);
}

TEST_CASE("classify counts, and distrusts what it cannot judge") {
  const std::vector<double> weights{0.9, 0.1, 0.25, std::nan("")};
  std::vector<std::uint8_t> dynamic(4);
  CHECK(classify<double>(weights, 0.25, dynamic) == 2);
  CHECK(dynamic == std::vector<std::uint8_t>{0, 1, 0, 1});
}

TEST_CASE_TEMPLATE("a weight depends on errors in standard deviations, whatever their size", S, float,
                   double) {
  for (const S size : {S(1e-30), S(1e-20), S(1), S(1e20), S(1e30)}) {
    KeypointResiduals<S> e;
    e.photometric = S(3) * size;
    e.reprojection = S(2) * size;
    e.depth = size;
    const StaticWeightScales<S> scales{size, size, size};
    CHECK(static_weight(e, scales, S(5)) == doctest::Approx(8.0 / 19.0));
  }
}

TEST_CASE_TEMPLATE("perfect matches are static: scales of exact residuals still weigh them", S, float,
                   double) {
  // Fault: a scale of 0 made 0 / 0 of a perfect point, whose weight NaN counts as dynamic.
  ScaleWorkspace<S> workspace;
  const std::vector<S> exact(20, S(0));
  const auto sigma = estimate_scale<S>(std::span<const S>(exact), {}, ScaleOptions<S>(), workspace);
  REQUIRE(sigma);
  const StaticWeightScales<S> scales{*sigma, *sigma, *sigma};
  const KeypointResiduals<S> perfect{S(0), S(0), S(0)};
  const S w = static_weight(perfect, scales, S(5));
  CHECK(w == doctest::Approx(8.0 / 5.0));
  CHECK_FALSE(is_dynamic(w, S(0.25)));
  KeypointResiduals<S> moved = perfect;
  moved.reprojection = S(5);
  CHECK(is_dynamic(static_weight(moved, scales, S(5)), S(0.25)));
}
