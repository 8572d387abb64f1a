// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/residual_batch.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/image/image.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// Two images of noise, depth with holes, and matches of which some are outside or behind the camera.
template <class S>
struct NoisyView {
  test::Rng rng{"residual batch"};
  Pinhole<S> camera{S(60), S(62), S(40), S(30)};
  Image<std::uint8_t> before{80, 60}, now{80, 60};
  Image<float> depth{80, 60};
  SE3<S> T;
  StaticWeightScales<S> scales{S(8), S(1), S(2)};
  DepthNoise<S> noise;

  NoisyView() {
    for (int i = 0; i < 80 * 60; ++i) {
      before.data()[i] = static_cast<std::uint8_t>(rng.integer(0, 255));
      now.data()[i] = static_cast<std::uint8_t>(rng.integer(0, 255));
      depth.data()[i] =
          rng.chance(0.2) ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(rng.uniform(0.5, 4));
    }
    Eigen::Matrix<S, 6, 1> xi;
    xi << S(0.05), S(-0.02), S(0.03), S(0.02), S(0.04), S(-0.03);
    T = SE3<S>::exp(xi);
  }

  [[nodiscard]] MatchRows<S> matches(int n) {
    MatchRows<S> rows;
    for (int k = 0; k < n; ++k)
      rows.push_back({S(rng.uniform(-5, 85)), S(rng.uniform(-5, 65))},
                     {S(rng.uniform(-2, 2)), S(rng.uniform(-2, 2)), S(k % 10 == 0 ? -1 : rng.uniform(1, 4))},
                     {S(rng.uniform(-5, 85)), S(rng.uniform(-5, 65))});
    return rows;
  }
};

}  // namespace

TEST_CASE_TEMPLATE("errors and weights of many matches are those of each one, outside and behind, too", S,
                   float, double) {
  NoisyView<S> view;
  const auto& [rng, camera, before, now, depth, T, scales, noise] = view;
  const MatchRows<S> rows = view.matches(150);
  ResidualRows<S> out;
  residual_batch<S>(camera, rows, before, now, depth, T, scales, noise, S(5), out);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Eigen::Matrix<S, 3, 1> p = T * Eigen::Matrix<S, 3, 1>(rows.p_x[k], rows.p_y[k], rows.p_z[k]);
    const Eigen::Matrix<S, 2, 1> x(rows.x[k], rows.y[k]), x_m(rows.x_m[k], rows.y_m[k]);
    const auto there = camera.project(p);
    if (!there) {
      CHECK(std::isinf(out.reprojection[k]));
      CHECK(out.weight[k] == S(0));
      continue;
    }
    const KeypointResiduals<S> r{photometric_residual(before, x, now, *there),
                                 reprojection_residual(*there, x_m), depth_residual(p, depth, x_m)};
    const StaticWeightScales<S> here{scales.photometric, scales.reprojection,
                                     scales.depth * noise.sigma(p.z())};
    CHECK(out.dimension[k] == S(r.dimension()));
    CHECK(
        out.reprojection[k] ==
        doctest::Approx(static_cast<double>(r.reprojection)).epsilon(std::is_same_v<S, float> ? 1e-4 : 1e-9));
    CHECK(std::abs(out.photometric[k] - r.photometric.value_or(S(0))) < S(0.05));
    CHECK(std::abs(out.depth[k] - r.depth.value_or(S(0))) < S(1e-4));
    CHECK(out.weight[k] ==
          doctest::Approx(static_cast<double>(static_weight<S>(r, here, S(5)))).epsilon(2e-3));
  }
}

TEST_CASE_TEMPLATE("grey values are the same numbers in images of any type", Pixel, std::uint16_t, float) {
  test::Rng rng("residual batch of any grey values");
  const Pinhole<float> camera(60.0F, 62.0F, 40.0F, 30.0F);
  Image<std::uint8_t> bytes(80, 60);
  Image<Pixel> same(80, 60);
  const Image<float> depth(80, 60, 2.0F);
  for (int i = 0; i < 80 * 60; ++i) {
    bytes.data()[i] = static_cast<std::uint8_t>(rng.integer(0, 255));
    same.data()[i] = static_cast<Pixel>(bytes.data()[i]);
  }
  MatchRows<float> rows;
  for (int k = 0; k < 70; ++k) {  // two blocks, of which parts are the same
    const Eigen::Vector2f x(static_cast<float>(rng.uniform(-2, 82)), static_cast<float>(rng.uniform(-2, 62)));
    rows.push_back(x, camera.ray(x) * 2.0F, x);
  }
  const StaticWeightScales<float> scales{8.0F, 1.0F, 2.0F};
  ResidualRows<float> out, expected;
  const auto run = [&](const auto& gray, ResidualRows<float>& to) {
    residual_batch<float>(camera, rows, gray, gray, depth, SE3<float>(), scales, {}, 5.0F, to);
  };
  run(bytes, expected);
  run(same, out);
  CHECK(out.photometric == expected.photometric);
  CHECK(out.weight == expected.weight);
}

TEST_CASE_TEMPLATE("wide vectors give the bits of narrow ones, in blocks and one by one", S, float, double) {
  if (!detail::has_wide_vectors()) {
    MESSAGE("skipped: no wider vectors than those of the compiler");
    return;
  }
  NoisyView<S> view;
  const auto& [rng, camera, before, now, depth, pose, scales, noise] = view;
  Eigen::Matrix<S, 3, 4> T;
  T << pose.rotation_matrix(), pose.translation();
  for (const int n : {13, 150}) {
    const MatchRows<S> rows = view.matches(n);
    ResidualRows<S> wide, narrow;
    residual_batch<S>(camera, rows, before, now, depth, pose, scales, noise, S(5), wide);
    narrow.resize(rows.size());
    detail::residual_blocks<S>(camera, rows, before, now, depth, T, scales, noise, S(5), narrow);
    CHECK(wide.photometric == narrow.photometric);
    CHECK(wide.reprojection == narrow.reprojection);
    CHECK(wide.depth == narrow.depth);
    CHECK(wide.weight == narrow.weight);
    CHECK(wide.dimension == narrow.dimension);
  }
}
