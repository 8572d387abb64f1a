// SPDX-License-Identifier: BSD-3-Clause
// What the surfaces of the synthetic office show.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "synth/random.hpp"

namespace dynslam::runtime::synth {

/// A picture repeated over a surface, with reduced copies against aliasing.
struct Texture {
  std::vector<cv::Mat> levels;  ///< CV_8UC3
  double texels_per_metre = 1;
};

/// All textures, and the numbers under which surfaces name them.
struct Textures {
  std::vector<Texture> all;
  int floor = 0, wall = 0, partition = 0, wood = 0, metal = 0, dark = 0, ceiling = 0, keyboard = 0,
      carton = 0, leaf = 0, cloth = 0, board = 0;
  std::vector<int> posters, screens, books, shirts, trousers, skins, hairs, mugs;
};

/// @param board  with the checked board of the scenario of that name
[[nodiscard]] Textures paint(Random& random, bool board);

}  // namespace dynslam::runtime::synth
