// SPDX-License-Identifier: BSD-3-Clause
#include "synth/random.hpp"

#include <cstddef>

namespace dynslam::runtime::synth {

double Random::uniform(double low, double high) {
  return low + (high - low) * generator_.unit<double>();
}
int Random::integer(int low, int high) {
  return low + static_cast<int>(generator_.index(static_cast<std::size_t>(high - low + 1)));
}
double Random::normal() {  // sum of uniforms: no transcendental functions, close enough for pictures
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += uniform(0, 1);
  return sum;
}

}  // namespace dynslam::runtime::synth
