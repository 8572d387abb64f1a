// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <optional>
#include <string_view>

#include "dynslam/dynamics/method.hpp"

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
/// Whether a mode finds movers by their motion.
[[nodiscard]] constexpr bool uses_geometry(DynamicsMode m) {
  return m == DynamicsMode::geometric || m == DynamicsMode::both;
}

/// With `paper` all features are alike, too; `full` takes people at rest and `Additions` beside the masks.
using dynslam::Method;

/// A method by its name; empty: there is none of that name.
[[nodiscard]] std::optional<Method> parse_method(std::string_view name);
/// Name of a method.
[[nodiscard]] std::string_view to_string(Method method);

/// What this system adds to the paper's tracking, beside the masks.
struct Additions {
  bool surface_weights = true;   ///< features count by the surface that they stand for (surface_weights())
  bool motion_prior = true;      ///< the predicted motion counts in the consensus, too
  bool strict_local_map = true;  ///< matches of the local map that are far off never enter the optimisation
  bool proven_points = false;    ///< points only on surfaces known to have stayed; needs geometric masks
  bool second_look = true;  ///< where the map in view does not tell the pose, the last frame enters it whole
  bool image_alignment = true;  ///< where few features lead from the last frame, its grey values are a start
  bool look_around = true;  ///< where far fewer points fit than usually, poses beside the one found are tried
  bool doubted_points = true;  ///< points of the map that stand where a mover is are doubted; geometric masks
};

/// What a run of a method and mode takes: nothing with the paper's, and with `none`, which is the baseline.
/// `proven_points` is taken by no mode of itself: with twenty keyframes adjusted together the points that it
/// leaves out are worth more than the few movers among them (docs/method.md).
[[nodiscard]] constexpr Additions additions(Method method, DynamicsMode mode) {
  const bool full = method == Method::full, geometry = full && uses_geometry(mode);
  const bool masked = full && mode != DynamicsMode::none;
  return {masked, masked, geometry, false, masked, masked, masked, geometry};
}

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
