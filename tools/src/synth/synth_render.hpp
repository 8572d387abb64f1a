// SPDX-License-Identifier: BSD-3-Clause
// Rasteriser and depth sensor of the synthetic sequences. Internal to the runtime.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "synth/synth_scene.hpp"

namespace dynslam::runtime::synth {

/// Exact pictures of one instant.
struct Rendering {
  cv::Mat bgr;                  ///< CV_8UC3, shaded
  cv::Mat depth;                ///< CV_32FC1 metres; 0 where nothing is seen
  cv::Mat cosine;               ///< CV_32FC1, between surface normal and viewing ray
  cv::Mat label, dynamic, box;  ///< CV_8UC1
  cv::Mat instance;             ///< CV_16UC1

  /// Adds the rows of another below.
  void append(const Rendering& below) {
    bgr.push_back(below.bgr), depth.push_back(below.depth), cosine.push_back(below.cosine);
    label.push_back(below.label), dynamic.push_back(below.dynamic), box.push_back(below.box);
    instance.push_back(below.instance);
  }
};

/// Renders triangles with perspective-correct textures and a z-buffer.
[[nodiscard]] Rendering render(std::span<const Triangle> triangles, const std::vector<Texture>& textures,
                               const Pinhole<double>& camera, const SE3<double>& T_c_w, int width,
                               int height);

/// What a structured-light camera would measure: disparity in steps of 1/8 px with noise (so that the
/// error grows with z^2), no value in the projector's shadow, on dark and on grazing surfaces, or
/// outside 0.45..7 m. CV_16UC1, 5000 per metre.
/// @param fx     focal length of the image [px]
/// @param scale  pixels of the image per pixel of the sensor that measures disparity
[[nodiscard]] cv::Mat sense_depth(const Rendering& exact, double fx, double scale, Random& random);

}  // namespace dynslam::runtime::synth
