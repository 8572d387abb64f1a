// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <optional>
#include <string_view>

#include "dynslam/dynamics/motion_method.hpp"

namespace dynslam::runtime {

/// Which masks remove features (the rows of the paper's Table 4).
enum class DynamicsMode { none, semantic, geometric, both };

/// A mode by its name; empty: there is none of that name.
[[nodiscard]] std::optional<DynamicsMode> parse_dynamics(std::string_view name);
/// Name of a mode.
[[nodiscard]] std::string_view to_string(DynamicsMode mode);
/// Whether a mode takes masks of a network or of files.
[[nodiscard]] constexpr bool uses_semantic(DynamicsMode m) {
  return m == DynamicsMode::semantic || m == DynamicsMode::both;
}
/// Whether a mode finds moving objects by their motion.
[[nodiscard]] constexpr bool uses_geometry(DynamicsMode m) {
  return m == DynamicsMode::geometric || m == DynamicsMode::both;
}

/// `full` takes people at rest and Additions beside the masks.
using dynslam::MotionMethod;

/// A method by its name; empty: there is none of that name.
[[nodiscard]] std::optional<MotionMethod> parse_method(std::string_view name);
/// Name of a method.
[[nodiscard]] std::string_view to_string(MotionMethod method);

/// What the search for a pose takes beside the paper's: features count by the surface that they stand for,
/// and the predicted motion counts, too; matches of the local map that are far off are dropped before it is
/// optimised; where few features lead from the last frame its grey values are a start. By mode: with the
/// full method in all modes but `none`, which is the baseline.
enum class Additions { by_mode, none, all };

/// Additions by their name, "auto": by mode; empty: there is none of that name.
[[nodiscard]] std::optional<Additions> parse_additions(std::string_view name);
/// Name of what is added.
[[nodiscard]] std::string_view to_string(Additions additions);

/// What a run of a method and mode takes.
[[nodiscard]] constexpr Additions additions(MotionMethod method, DynamicsMode mode) {
  return method == MotionMethod::paper || mode == DynamicsMode::none ? Additions::none : Additions::all;
}

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
