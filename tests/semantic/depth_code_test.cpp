// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/depth_code.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "random.hpp"

using namespace dynslam;

TEST_CASE("every code is a depth of its own, ascending, and comes back") {
  float last = 0;
  for (int bits = 0; bits < 65536; ++bits) {
    const float z = DepthCode(static_cast<std::uint16_t>(bits)).metres();
    CHECK(z > last);
    CHECK(DepthCode::of(z).bits == bits);
    last = z;
  }
  CHECK(DepthCode(0).metres() == DepthCode::kLeast);
  CHECK(last == DepthCode::kMost);
}

TEST_CASE_TEMPLATE("depths are kept to a share of 2^-12, and those beyond become the outermost", S, float,
                   double) {
  test::Rng rng("depth code");
  for (int k = 0; k < 20000; ++k) {
    const S z = static_cast<S>(std::exp2(rng.uniform(-12, 19.9)));
    const S back = static_cast<S>(DepthCode::of(z).metres());
    CHECK(std::abs(back - z) <= z * S(1.0 / 4096));
  }
  for (const S z : {S(0.5), S(1), S(2.5), S(64), S(4096)})
    CHECK(static_cast<S>(DepthCode::of(z).metres()) == z);
  CHECK(DepthCode::of(std::numeric_limits<S>::max()).metres() == DepthCode::kMost);
  CHECK(DepthCode::of(S(1e7)).metres() == DepthCode::kMost);
  CHECK(DepthCode::of(S(1e-5)).metres() == DepthCode::kLeast);
  CHECK(DepthCode::of(std::numeric_limits<S>::denorm_min()).metres() == DepthCode::kLeast);
}
