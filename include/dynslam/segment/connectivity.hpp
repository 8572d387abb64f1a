// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <span>

namespace dynslam {

/// Which pixels are neighbours: those that share an edge, or those that share a corner, too. A region and the
/// background around it must differ in it, or a diagonal line both separates and does not.
enum class Connectivity { four = 4, eight = 8 };

/// A step to a neighbouring pixel.
struct PixelStep {
  int du, dv;
};

/// The steps to all neighbours.
[[nodiscard]] inline std::span<const PixelStep> neighbour_steps(Connectivity connectivity) {
  static constexpr std::array<PixelStep, 8> kSteps{
      {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}}};
  return std::span<const PixelStep>(kSteps).first(connectivity == Connectivity::eight ? 8 : 4);
}

}  // namespace dynslam
