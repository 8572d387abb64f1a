// SPDX-License-Identifier: BSD-3-Clause
#include "synth/synth_scene.hpp"

#include <cmath>

namespace dynslam::runtime::synth {

Scene::Scene(const SynthOptions& options) : options_(options) {
  Random r(options.seed * 0x51ED2701ULL + 17);
  textures_ = paint(r, options_.scenario == "board");
  furniture_ = furnish(r, textures_, {options_.path == "loop", options_.scenario == "crowd"});
  std::uint16_t instances = furniture_.instances;
  const int walkers = options_.scenario == "walking" ? options_.walkers : 0;
  for (int k = 0; k < walkers; ++k)
    walkers_.push_back(make_walker(r, textures_, k, ++instances, options_.box && k == 0));
  sitter_ = ++instances;
  if (options_.scenario == "crowd")
    crowd_.emplace(r, textures_, furniture_.counter, options_.walkers, instances);
}

std::vector<Triangle> Scene::triangles(double t) const {
  std::vector<Triangle> out = furniture_.triangles;
  for (const Walker& walker : walkers_) add_walker(out, textures_, walker, t);
  if (options_.scenario == "walking" || options_.scenario == "sitting")
    add_sitter(out, textures_, furniture_.sitter_x, furniture_.sitter_y, sitter_, t);
  if (options_.scenario == "board") {  // it fills a sixth of the view and has most of its corners
    const double x = 0.35 * std::sin(1.1 * t), y = 1.0 + 0.1 * std::sin(0.7 * t),
                 z = 1.2 + 0.1 * std::sin(1.3 * t);
    box(out, at(x, y, z, 0.25 * std::sin(0.8 * t)), {0.8, 0.03, 0.6}, textures_.board,
        {Label::background, 0, true, true});
  }
  if (options_.scenario == "box") {
    const double x = 0.9 * std::sin(0.9 * t - 1.2), y = 1.0 + 0.25 * std::sin(0.6 * t),
                 z = 1.15 + 0.15 * std::sin(1.1 * t);
    box(out, at(x, y, z, 0.5 * std::sin(0.7 * t)), {0.55, 0.3, 0.45}, textures_.carton,
        {Label::background, 0, true, true});
  }
  if (crowd_) crowd_->add(out, textures_, t);
  return out;
}

}  // namespace dynslam::runtime::synth
