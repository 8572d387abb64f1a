// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "dynslam/robust/split_mix64.hpp"

namespace dynslam::runtime::synth {

/// What pictures and sensors draw from the generator.
class Random {
 public:
  explicit Random(std::uint64_t seed) : generator_(seed) {}
  double uniform(double low, double high);
  int integer(int low, int high);  ///< both ends included
  double normal();

 private:
  SplitMix64 generator_;
};

}  // namespace dynslam::runtime::synth
