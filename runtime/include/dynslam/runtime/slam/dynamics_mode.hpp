// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
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

/// With `paper` all features are alike, too; `full` takes people at rest and `Additions` beside the masks.
using dynslam::MotionMethod;

/// A method by its name; empty: there is none of that name.
[[nodiscard]] std::optional<MotionMethod> parse_method(std::string_view name);
/// Name of a method.
[[nodiscard]] std::string_view to_string(MotionMethod method);

/// What this system adds to the paper's tracking, beside the masks. Each is off until it is switched on by
/// its name: with a list of values in a row, a field that is added later would keep its default unnoticed.
struct Additions {
  bool surface_weights = false;   ///< features count by the surface that they stand for (surface_weights())
  bool motion_prior = false;      ///< the predicted motion counts in the consensus, too
  bool strict_local_map = false;  ///< matches of the local map that are far off never enter the optimisation
  bool proven_points = false;     ///< points only on surfaces known to have stayed; needs geometric masks
  bool image_alignment = false;  ///< where few features lead from the last frame, its grey values are a start

  constexpr Additions() = default;  // declared: no aggregate
  [[nodiscard]] static constexpr Additions none() { return {}; }
  [[nodiscard]] static constexpr Additions all();
  [[nodiscard]] friend constexpr bool operator==(const Additions&, const Additions&) = default;
};

/// A switch of Additions and its name.
struct Addition {
  std::string_view name;
  bool Additions::*on;
};
/// All of them.
inline constexpr std::array<Addition, 5> kAdditions{{
    {"surface_weights", &Additions::surface_weights},
    {"motion_prior", &Additions::motion_prior},
    {"strict_local_map", &Additions::strict_local_map},
    {"proven_points", &Additions::proven_points},
    {"image_alignment", &Additions::image_alignment},
}};

constexpr Additions Additions::all() {
  Additions result;
  for (const Addition& one : kAdditions) result.*one.on = true;
  return result;
}

static_assert(sizeof(Additions) == kAdditions.size() * sizeof(bool) &&
                  [] {
                    Additions seen;
                    for (const Addition& one : kAdditions) {
                      if (seen.*one.on) return false;
                      seen.*one.on = true;
                    }
                    return true;
                  }(),
              "every field of Additions stands once in kAdditions");

/// What a run of a method and mode takes: nothing with the paper's, and with `none`, which is the baseline.
/// `proven_points` is taken by no mode of itself: with twenty keyframes adjusted together the points that it
/// leaves out are worth more than the few moving objects among them (docs/method.md).
[[nodiscard]] constexpr Additions additions(MotionMethod method, DynamicsMode mode) {
  if (method == MotionMethod::paper || mode == DynamicsMode::none) return Additions::none();
  Additions result = Additions::all();
  result.proven_points = false;
  result.strict_local_map = uses_geometry(mode);
  return result;
}

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
