// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/eval/reliability.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

using namespace dynslam;

namespace {

double log_odds(double p) {
  return std::log(p / (1 - p));
}

}  // namespace

TEST_CASE("who says 0.75 and is right three times in four is calibrated") {
  ReliabilityDiagram diagram;
  for (int i = 0; i < 400; ++i) diagram.add(log_odds(0.75), i % 4 != 0);
  CHECK(diagram.tenth(7).statements == 400);
  CHECK(diagram.tenth(7).said == doctest::Approx(0.75));
  CHECK(diagram.tenth(7).happened == doctest::Approx(0.75));
  CHECK(diagram.tenth(6).statements == 0);
  CHECK(diagram.largest_error() < 1e-12);
}

TEST_CASE("who says 0.95 and is right half of the time is found out, unless that is hardly ever") {
  ReliabilityDiagram diagram;
  for (int i = 0; i < 20; ++i) diagram.add(static_cast<float>(log_odds(0.95)), i % 2 == 0);
  CHECK(diagram.largest_error() == doctest::Approx(0.45));
  for (int i = 0; i < 10000; ++i) diagram.add(log_odds(0.001), false);
  CHECK(diagram.largest_error() == doctest::Approx(0.001));
  CHECK(diagram.largest_error(0) == doctest::Approx(0.45));
}

TEST_CASE("certainty is counted, and what is not a number is not") {
  ReliabilityDiagram diagram;
  diagram.add(std::numeric_limits<double>::infinity(), true);
  diagram.add(-std::numeric_limits<float>::infinity(), false);
  diagram.add(std::numeric_limits<double>::quiet_NaN(), true);
  CHECK(diagram.statements() == 2);
  CHECK(diagram.tenth(9).happened == 1);
  CHECK(diagram.tenth(0).statements == 1);
}
