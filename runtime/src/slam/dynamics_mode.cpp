// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/dynamics_mode.hpp"

#include <array>
#include <cstddef>
#include <initializer_list>

namespace dynslam::runtime {
namespace {

/// That of `all` which has a name.
template <class E>
std::optional<E> with_name(std::string_view name, std::initializer_list<E> all) {
  for (const E one : all) {
    if (name == to_string(one)) return one;
  }
  return std::nullopt;
}

}  // namespace

std::optional<DynamicsMode> parse_dynamics(std::string_view name) {
  return with_name(name,
                   {DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric, DynamicsMode::both});
}

std::string_view to_string(DynamicsMode mode) {
  constexpr std::array<std::string_view, 4> kNames{"none", "semantic", "geometric", "both"};
  return kNames[static_cast<std::size_t>(mode)];
}

std::optional<MotionMethod> parse_method(std::string_view name) {
  return with_name(name, {MotionMethod::paper, MotionMethod::full});
}

std::string_view to_string(MotionMethod method) {
  return method == MotionMethod::paper ? "paper" : "full";
}

std::optional<Additions> parse_additions(std::string_view name) {
  return with_name(name, {Additions::by_mode, Additions::none, Additions::all});
}

std::string_view to_string(Additions additions) {
  constexpr std::array<std::string_view, 3> kNames{"auto", "none", "all"};
  return kNames[static_cast<std::size_t>(additions)];
}

}  // namespace dynslam::runtime
