// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/robust/consensus.hpp"

#include <doctest/doctest.h>

#include <set>

#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("as many samples are needed as Fischler and Bolles say", S, float, double) {
  CHECK(samples_needed<3>(S(0.5), S(0.99), 1000) == 35);
  CHECK(samples_needed<8>(S(0.6), S(0.99), 1000) == 272);
  CHECK(samples_needed<3>(S(1), S(0.99), 1000) == 0);
  CHECK(samples_needed<3>(S(0), S(0.99), 1000) == 1000);
  CHECK(samples_needed<8>(S(0.01), S(0.99), 1000) == 1000);  // below rounding: never fewer, no overflow
  CHECK(samples_needed<3>(S(0.9), S(0), 1000) == 1000);      // no confidence asked for: all
}

TEST_CASE("drawn indices differ, are all reached, and are the same for the same seed") {
  SplitMix64 random(3), again(3);
  std::set<std::size_t> seen;
  for (int k = 0; k < 200; ++k) {
    std::array<std::size_t, 4> a{}, b{};
    draw_distinct(random, 6, a);
    draw_distinct(again, 6, b);
    CHECK(a == b);
    CHECK(std::set<std::size_t>(a.begin(), a.end()).size() == 4);
    seen.insert(a.begin(), a.end());
  }
  CHECK(seen.size() == 6);
}

TEST_CASE("the loop stops when the inliers allow it, counts refused samples, and judges each hypothesis") {
  SamplingOptions<double> options;
  options.max_iterations = 100;
  int draws = 0, judged = 0;
  const auto draw = [&](SplitMix64&, std::array<std::size_t, 2>&) { return ++draws % 2 == 0; };
  const auto solve = [](const std::array<std::size_t, 2>&, const auto& consider) {
    consider(1.0);
    consider(2.0);  // two hypotheses of one sample
  };
  const auto never = [&](double) -> std::optional<double> {
    ++judged;
    return std::nullopt;
  };
  CHECK(sample_consensus<2>(options, draw, solve, never) == 100);
  CHECK(draws == 100);
  CHECK(judged == 100);
  draws = 0;
  const auto perfect = [](double) -> std::optional<double> { return 1.0; };
  CHECK(sample_consensus<2>(options, draw, solve, perfect) == 2);
}
