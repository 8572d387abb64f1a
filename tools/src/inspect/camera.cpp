// SPDX-License-Identifier: BSD-3-Clause
// Warnings of a camera before an image is looked at.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dynslam/runtime/inspect/inspect.hpp"

namespace dynslam::runtime {
namespace {

/// Largest distance between where two cameras of one size see a point, over rays to their pixels [px].
double largest_difference(const CameraConfig& a, const CameraConfig& b) {
  constexpr int kSteps = 16;
  double most = 0;
  for (int j = 0; j <= kSteps; ++j) {
    for (int i = 0; i <= kSteps; ++i) {
      const Eigen::Vector2d x((a.width - 1.0) * i / kSteps, (a.height - 1.0) * j / kSteps);
      const auto p = a.model.unproject(x, 1.0);
      const auto y = p ? b.model.project(*p) : std::nullopt;
      if (y) most = std::max(most, (*y - x).norm());
    }
  }
  return most;
}

/// Against the camera that the name of the folder, or of the bag, speaks of.
void judge_name(const Sequence& sequence, const CameraConfig& camera, std::vector<std::string>& warnings) {
  const std::string& named = sequence.folder_camera;
  const char* whose = sequence.format == "bag" ? "bag" : sequence.format == "ros2" ? "recording" : "folder";
  constexpr double kSame = 0.01;  // of focal lengths, units and the width
  const CameraConfig expected = load_camera(named);
  const auto &k = camera.model.pinhole(), &e = expected.model.pinhole();
  const double apart = largest_difference(camera, expected);
  if (std::abs(k.fx() / e.fx() - 1) > kSame || std::abs(k.fy() / e.fy() - 1) > kSame) {
    warnings.push_back(
        fmt::format("the {}'s name speaks of {} (fx {:.1f}, fy {:.1f}), the camera {} has "
                    "fx {:.1f}, fy {:.1f}",
                    whose, named, e.fx(), e.fy(), camera.name, k.fx(), k.fy()));
  } else if (apart > kSame * camera.width) {
    warnings.push_back(fmt::format(
        "the {}'s name speaks of {}, whose centre or lens puts pixels up to {:.0f} px beside those of "
        "the camera {}",
        whose, named, apart, camera.name));
  }
  if (sequence.depth_units > 0) return;  // the format has its own
  if (std::abs(camera.depth_units_per_metre / expected.depth_units_per_metre - 1) > kSame)
    warnings.push_back(
        fmt::format("the {}'s name speaks of {} ({} depth units per metre), the camera {} has {}", whose,
                    named, expected.depth_units_per_metre, camera.name, camera.depth_units_per_metre));
}

}  // namespace

std::vector<std::string> camera_doubts(const Sequence& sequence, const CameraConfig& camera) {
  std::vector<std::string> warnings;
  const auto& k = camera.model.pinhole();
  constexpr double kAside = 0.15, kSquare = 0.1;
  if (!sequence.folder_camera.empty()) judge_name(sequence, camera, warnings);
  if (std::abs(k.cx() / camera.width - 0.5) > kAside || std::abs(k.cy() / camera.height - 0.5) > kAside)
    warnings.push_back(fmt::format("the camera's centre ({:.1f}, {:.1f}) is far from the middle of {}x{}",
                                   k.cx(), k.cy(), camera.width, camera.height));
  if (std::abs(k.fx() / k.fy() - 1) > kSquare)
    warnings.push_back(fmt::format("the camera's fx {:.1f} and fy {:.1f} differ by {:.0f} %", k.fx(), k.fy(),
                                   100 * std::abs(k.fx() / k.fy() - 1)));
  return warnings;
}

}  // namespace dynslam::runtime
