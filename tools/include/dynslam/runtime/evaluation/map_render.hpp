// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <opencv2/core.hpp>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"

namespace dynslam::runtime {

/// From where and how a map is drawn.
struct MapView {
  SE3<double> T_w_c;   ///< viewpoint
  double focal = 700;  ///< pixels
  cv::Size size{1200, 900};
};

/// What a picture's colours mean.
enum class MapColours : std::uint8_t {
  classes,  ///< chairs and displays in their class's colour, all else as it was seen
  height    ///< along `up`, from blue (low) to red (high)
};

/// A viewpoint behind and above a camera of the run, so that what it saw is in view.
[[nodiscard]] MapView view_behind(const SE3<double>& T_w_c, double back = 1.6, double up = 1.0);

/// Moves a view back, and turns it, until nearly all occupied voxels are in the picture.
[[nodiscard]] MapView fit_view(const interop::SemanticOcTree& tree, MapView view);

/// Picture of the occupied voxels, drawn as shaded cubes; needs no display.
/// @param up  direction that counts as height, in the map's frame
[[nodiscard]] cv::Mat render_map(const interop::SemanticOcTree& tree, const MapView& view,
                                 MapColours colours = MapColours::classes,
                                 const Eigen::Vector3d& up = Eigen::Vector3d(0, -1, 0));

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
