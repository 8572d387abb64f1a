// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/optim/patch_alignment.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "dynslam/image/image.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A smooth texture that can be evaluated anywhere, so that the true position of a patch is known.
double texture(double u, double v) {
  return 120 + 40 * std::sin(0.55 * u + 0.2 * v) + 35 * std::cos(0.48 * v - 0.15 * u) +
         15 * std::sin(0.9 * u) * std::cos(0.7 * v);
}

Image<std::uint8_t> shifted(double du, double dv, double gain, double bias, double noise, test::Rng& rng) {
  Image<std::uint8_t> image(64, 64);
  for (int v = 0; v < 64; ++v) {
    for (int u = 0; u < 64; ++u) {
      image(u, v) = static_cast<std::uint8_t>(
          std::lround(gain * texture(u - du, v - dv) + bias + noise * rng.normal()));
    }
  }
  return image;
}

template <class S>
std::array<S, 100> bordered(double u, double v) {
  std::array<S, 100> out{};
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 10; ++x)
      out[static_cast<std::size_t>(y * 10 + x)] = static_cast<S>(texture(u + x - 5, v + y - 5));
  }
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("a patch is found to a twentieth of a pixel, brighter or darker, with noise", S, float,
                   double) {
  test::Rng rng("patch alignment");
  for (int trial = 0; trial < 200; ++trial) {
    CAPTURE(trial);
    const double du = rng.uniform(-1.5, 1.5), dv = rng.uniform(-1.5, 1.5);
    const auto image = shifted(du, dv, 1.0, rng.uniform(-25, 25), 1.0, rng);
    AlignmentPatch<S> patch;
    REQUIRE(patch.set(bordered<S>(30, 32), S(8)));
    const auto found = patch.align(image.view(), Eigen::Matrix<S, 2, 1>(S(30), S(32)));
    REQUIRE(found.ok());
    CHECK(static_cast<double>(found.x.x()) == doctest::Approx(30 + du).epsilon(0.003));
    CHECK(static_cast<double>(found.x.y()) == doctest::Approx(32 + dv).epsilon(0.003));
    CHECK(found.correlation > S(0.97));
  }
}

TEST_CASE_TEMPLATE("flat and straight-edged templates are refused: they have no position", S, float, double) {
  std::array<S, 100> flat{}, edge{};
  flat.fill(S(90));
  for (std::size_t k = 0; k < 100; ++k) edge[k] = k % 10 < 5 ? S(40) : S(200);
  AlignmentPatch<S> patch;
  CHECK_FALSE(patch.set(flat, S(8)));
  CHECK_FALSE(patch.set(edge, S(8)));
}

TEST_CASE_TEMPLATE("another texture, a distant start and the border are no match", S, float, double) {
  test::Rng rng("patch refused");
  AlignmentPatch<S> patch;
  REQUIRE(patch.set(bordered<S>(30, 32), S(8)));
  Image<std::uint8_t> noise(64, 64);
  int accepted = 0;
  for (int trial = 0; trial < 100; ++trial) {
    for (int v = 0; v < 64; ++v) {
      for (int u = 0; u < 64; ++u) noise(u, v) = static_cast<std::uint8_t>(rng.integer(0, 255));
    }
    accepted += patch.align(noise.view(), Eigen::Matrix<S, 2, 1>(30, 32)).ok() ? 1 : 0;
  }
  CHECK(accepted == 0);
  const auto image = shifted(3, 0, 1, 0, 0, rng);
  PatchAlignmentOptions<S> near;
  near.max_shift = S(2);
  CHECK(patch.align(image.view(), Eigen::Matrix<S, 2, 1>(30, 32), near).status ==
        PatchAlignmentStatus::too_far);
  CHECK(patch.align(image.view(), Eigen::Matrix<S, 2, 1>(2, 32)).status == PatchAlignmentStatus::outside);
  CHECK_FALSE(
      patch.align(image.view(), Eigen::Matrix<S, 2, 1>(std::numeric_limits<S>::quiet_NaN(), 32)).ok());
}
