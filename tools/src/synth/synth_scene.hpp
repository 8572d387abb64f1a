// SPDX-License-Identifier: BSD-3-Clause
// The synthetic office. Internal to the runtime.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "dynslam/runtime/synth/synth.hpp"
#include "synth/crowd.hpp"
#include "synth/furniture.hpp"
#include "synth/people.hpp"
#include "synth/random.hpp"
#include "synth/solids.hpp"
#include "synth/textures.hpp"

namespace dynslam::runtime::synth {

/// Static furniture, and people and boxes that depend on time. World: x right, y forward, z up.
class Scene {
 public:
  explicit Scene(const SynthOptions& options);
  [[nodiscard]] const std::vector<Texture>& textures() const { return textures_.all; }
  /// Everything at `t` seconds.
  [[nodiscard]] std::vector<Triangle> triangles(double t) const;

 private:
  SynthOptions options_;
  Textures textures_;
  Furniture furniture_;
  std::vector<Walker> walkers_;
  std::optional<Crowd> crowd_;
  std::uint16_t sitter_ = 0;
};

}  // namespace dynslam::runtime::synth
