// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/dynamics_mode.hpp"

#include <array>
#include <cstddef>

namespace dynslam::runtime {

std::optional<DynamicsMode> parse_dynamics(std::string_view name) {
  for (const auto mode :
       {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both}) {
    if (name == to_string(mode)) return mode;
  }
  return std::nullopt;
}

std::string_view to_string(DynamicsMode mode) {
  constexpr std::array<std::string_view, 4> kNames{"none", "semantic", "geometric", "both"};
  return kNames[static_cast<std::size_t>(mode)];
}

std::optional<MotionMethod> parse_method(std::string_view name) {
  for (const auto method : {MotionMethod::paper, MotionMethod::full}) {
    if (name == to_string(method)) return method;
  }
  return std::nullopt;
}

std::string_view to_string(MotionMethod method) {
  return method == MotionMethod::paper ? "paper" : "full";
}

std::optional<Additions> parse_additions(std::string_view name) {
  for (const auto one : {Additions::by_mode, Additions::none, Additions::all}) {
    if (name == to_string(one)) return one;
  }
  return std::nullopt;
}

std::string_view to_string(Additions additions) {
  constexpr std::array<std::string_view, 3> kNames{"auto", "none", "all"};
  return kNames[static_cast<std::size_t>(additions)];
}

}  // namespace dynslam::runtime
