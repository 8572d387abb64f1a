// SPDX-License-Identifier: BSD-3-Clause
// Rival of the semantic maps: what a user of OctoMap's ColorOcTree does.
#pragma once

#include <octomap/ColorOcTree.h>

#include <cstddef>
#include <vector>

namespace dynslam::baselines {

/// Scans with `origin` and `points` (p, rgb) as OctoMap takes them; the scans must outlive it.
template <class Scan>
class ColorTreeScans {
 public:
  ColorTreeScans(const std::vector<Scan>& scans, double max_range) : scans_(scans), max_range_(max_range) {
    for (const Scan& scan : scans) {
      clouds_.emplace_back();
      for (const auto& point : scan.points) clouds_.back().push_back(point.p.x(), point.p.y(), point.p.z());
    }
  }

  /// insertPointCloud, then the colour of every point.
  void insert(octomap::ColorOcTree& tree, bool lazy, bool discretize) const {
    for (std::size_t k = 0; k < scans_.size(); ++k) {
      const auto& o = scans_[k].origin;
      tree.insertPointCloud(clouds_[k], octomap::point3d(o.x(), o.y(), o.z()), max_range_, lazy, discretize);
      for (const auto& point : scans_[k].points) {
        if ((point.p - o).norm() > static_cast<float>(max_range_)) continue;
        tree.integrateNodeColor(point.p.x(), point.p.y(), point.p.z(), point.rgb[0], point.rgb[1],
                                point.rgb[2]);
      }
      if (lazy) tree.updateInnerOccupancy();
    }
  }

 private:
  const std::vector<Scan>& scans_;
  double max_range_;
  std::vector<octomap::Pointcloud> clouds_;
};

}  // namespace dynslam::baselines
