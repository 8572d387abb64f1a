// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string_view>

namespace dynslam::runtime {

/// Which masks remove features (the rows of the paper's Table 4).
enum class DynamicsMode { none, semantic, geometric, both };

[[nodiscard]] std::optional<DynamicsMode> parse_dynamics(std::string_view name);
[[nodiscard]] std::string_view to_string(DynamicsMode mode);
[[nodiscard]] constexpr bool uses_semantic(DynamicsMode m) {
  return m == DynamicsMode::semantic || m == DynamicsMode::both;
}
[[nodiscard]] constexpr bool uses_geometry(DynamicsMode m) {
  return m == DynamicsMode::geometric || m == DynamicsMode::both;
}

}  // namespace dynslam::runtime
