// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/view/view_scene.hpp"

namespace dynslam::runtime {

std::vector<ViewVoxel> view_voxels(const interop::SemanticOcTree& tree, std::size_t most) {
  constexpr unsigned kCoarsest = 8;  // of 16 levels
  std::vector<ViewVoxel> voxels;
  for (unsigned depth = tree.getTreeDepth();; --depth) {
    voxels.clear();
    bool fits = true;
    for (auto it = tree.begin_leafs(static_cast<unsigned char>(depth)), end = tree.end_leafs();
         fits && it != end; ++it) {
      if (!tree.isNodeOccupied(*it)) continue;
      const octomap::point3d centre = it.getCoordinate();
      voxels.push_back({{centre.x(), centre.y(), centre.z()},
                        static_cast<float>(it.getSize()),
                        it->label(),
                        voxel_colour(*it)});
      fits = voxels.size() <= most || depth == kCoarsest;
    }
    if (fits) return voxels;
  }
}

}  // namespace dynslam::runtime
