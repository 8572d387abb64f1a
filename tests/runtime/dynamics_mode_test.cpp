// SPDX-License-Identifier: BSD-3-Clause
// Which of the system's additions a method and a mode take.
#include "dynslam/runtime/slam/dynamics_mode.hpp"

#include <doctest/doctest.h>

#include <array>

#include "dynslam/runtime/evaluation/ablate.hpp"

using namespace dynslam::runtime;

namespace {

constexpr std::array kModes{DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric,
                            DynamicsMode::both};

}  // namespace

TEST_CASE("the paper's method takes no addition, in run and in ablate; none is the baseline of run") {
  for (const DynamicsMode mode : kModes) CHECK(additions(MotionMethod::paper, mode) == Additions::none);
  CHECK(ablation_additions(MotionMethod::paper) == Additions::none);
  CHECK(additions(MotionMethod::full, DynamicsMode::none) == Additions::none);
}

TEST_CASE("the full method takes the additions in all modes but none, and in all of an ablation") {
  for (const DynamicsMode mode : {DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both})
    CHECK(additions(MotionMethod::full, mode) == Additions::all);
  CHECK(ablation_additions(MotionMethod::full) == Additions::all);
}
