// SPDX-License-Identifier: BSD-3-Clause
// Rival of the questions to a map: OctoMap's OcTree. It has no search for the nearest obstacle; what stands
// for it is a look at the occupied leaves of a box that is doubled until the nearest one in it is nearer than
// the box's sides.
#pragma once

#include <octomap/OcTree.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "dynslam/semantic/map_query.hpp"
#include "dynslam/semantic/scan_voxels.hpp"

namespace dynslam::baselines {

/// The voxels of a finished scan, each once.
inline void insert_voxels(octomap::OcTree& tree, const ScanVoxels& scan) {
  for (const std::uint32_t b : scan.order()) {
    const ScanBlock& block = scan.block(b);
    for (std::size_t i = 0; i < 512; ++i) {
      const bool hit = (block.hit[i >> 6] >> (i & 63) & 1) != 0,
                 miss = (block.miss[i >> 6] >> (i & 63) & 1) != 0;
      if (!hit && !miss) continue;
      const VoxelKey low = block.key(), offset = ScanVoxels::offset_in_block(i);
      octomap::OcTreeKey key;
      for (std::size_t a = 0; a < 3; ++a)
        key[static_cast<unsigned>(a)] = static_cast<octomap::key_type>(low[a] + offset[a]);
      tree.updateNode(key, hit, true);
    }
  }
  tree.updateInnerOccupancy();
  tree.prune();
}

/// Distance to the nearest occupied leaf; infinity where there is none within `most`.
[[nodiscard]] inline double nearest_in_boxes(const octomap::OcTree& tree, const Eigen::Vector3d& p,
                                             double most) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  for (double reach = 0.4;; reach *= 2) {
    const auto corner = [&](double sign) {
      return octomap::point3d(static_cast<float>(p.x() + sign * reach),
                              static_cast<float>(p.y() + sign * reach),
                              static_cast<float>(p.z() + sign * reach));
    };
    double best = kNone;
    for (auto it = tree.begin_leafs_bbx(corner(-1), corner(1)), end = tree.end_leafs_bbx(); it != end; ++it) {
      if (!tree.isNodeOccupied(*it)) continue;
      best = std::min(best, distance_to_cell(p, {it.getX(), it.getY(), it.getZ()}, it.getSize()));
    }
    if (best <= reach) return best;
    if (reach > most) return kNone;
  }
}

}  // namespace dynslam::baselines
