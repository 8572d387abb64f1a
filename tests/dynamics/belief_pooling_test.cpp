// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/belief_pooling.hpp"

#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <cmath>

#include "dynslam/image/image.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

constexpr int kW = 14, kH = 10;

/// The minimum of the energy by a dense solver.
Eigen::VectorXd exact(const Image<float>& depth, const Image<float>& confidence, const Image<float>& belief,
                      const PoolingOptions& o) {
  const int n = kW * kH;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd b(n);
  const auto couple = [&](int u, int v, int du, int dv) {
    const int x = u + du, y = v + dv;
    if (x >= kW || y >= kH) return;
    const auto k = static_cast<double>(detail::coupling(depth(u, v), depth(x, y), o));
    const int i = v * kW + u, j = y * kW + x;
    A(i, i) += k;
    A(j, j) += k;
    A(i, j) -= k;
    A(j, i) -= k;
  };
  for (int v = 0; v < kH; ++v) {
    for (int u = 0; u < kW; ++u) {
      couple(u, v, 1, 0);
      couple(u, v, 0, 1);
      A(v * kW + u, v * kW + u) += static_cast<double>(confidence(u, v));
      b(v * kW + u) = static_cast<double>(confidence(u, v)) * static_cast<double>(belief(u, v));
    }
  }
  return A.ldlt().solve(b);
}

}  // namespace

TEST_CASE("pooled beliefs are the minimum of their energy") {
  test::Rng rng("pooling");
  PoolingOptions options;
  options.sweeps = 40;
  Image<float> depth(kW, kH), confidence(kW, kH), belief(kW, kH);
  for (int v = 0; v < kH; ++v) {
    for (int u = 0; u < kW; ++u) {
      depth(u, v) = rng.chance(0.05) ? std::nanf("") : static_cast<float>((u < 7 ? 1.5 : 2.5) + rng.uniform(0, 0.03));
      confidence(u, v) = rng.chance(0.5) ? 1.0F : 0.02F;
      belief(u, v) = static_cast<float>(rng.uniform(-5, 5));
    }
  }
  const Eigen::VectorXd expected = exact(depth, confidence, belief, options);
  PoolingWorkspace ws;
  pool_beliefs(depth, confidence, belief, options, ws);
  for (int c = 0; c < kW * kH; ++c) CHECK(belief.data()[c] == doctest::Approx(expected(c)).epsilon(0.01).scale(1));
}

TEST_CASE("a surface that was not seen before takes the belief of what it is one with, and of nothing else") {
  Image<float> depth(kW, kH), confidence(kW, kH, 0.02F), belief(kW, kH, -2.0F);
  for (int v = 0; v < kH; ++v) {
    for (int u = 0; u < kW; ++u) depth(u, v) = u < 7 ? 1.5F : 2.5F;
  }
  for (int v = 0; v < kH; ++v) {
    confidence(6, v) = 1;
    belief(6, v) = 5;
  }
  PoolingWorkspace ws;
  pool_beliefs(depth, confidence, belief, {}, ws);
  CHECK(belief(5, 5) > 2);
  CHECK(belief(3, 5) > -1);
  CHECK(belief(7, 5) == doctest::Approx(-2));
}

TEST_CASE("feet that were seen to move do not make the floor move that they stand on") {
  // A floor that was seen at rest, and two cells of a foot on it at the same depth.
  Image<float> depth(kW, kH, 2.0F), confidence(kW, kH, 1.0F), belief(kW, kH, -5.0F);
  belief(6, 5) = belief(7, 5) = 6;
  PoolingWorkspace ws;
  pool_beliefs(depth, confidence, belief, {}, ws);
  int moving = 0;
  for (int c = 0; c < kW * kH; ++c) moving += belief.data()[c] > 0 ? 1 : 0;
  CHECK(moving <= 2);
}
