// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <octomap/ColorOcTree.h>

#include <opencv2/core.hpp>

#include "dynslam/geometry/se3.hpp"

namespace dynslam::runtime {

struct MapView {
  SE3<double> T_w_c;             ///< viewpoint
  double focal = 700;            ///< pixels
  cv::Size size{1200, 900};
};

/// A viewpoint behind and above a camera of the run, so that what it saw is in view.
[[nodiscard]] MapView view_behind(const SE3<double>& T_w_c, double back = 1.6, double up = 1.0);

/// Picture of the occupied voxels, drawn as shaded cubes in their own colours; needs no display.
[[nodiscard]] cv::Mat render_map(const octomap::ColorOcTree& tree, const MapView& view);

}  // namespace dynslam::runtime
