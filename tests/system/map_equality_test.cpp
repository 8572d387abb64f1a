// SPDX-License-Identifier: BSD-3-Clause
// Recorded keyframes: the tree of OctoMap's insertPointCloud.
#include <doctest/doctest.h>
#include <octomap/OcTree.h>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "recorded_scans.hpp"
#include "tree_compare.hpp"

using namespace dynslam;

TEST_CASE("20 recorded keyframes give the tree of insertPointCloud, at 5 cm and 2 cm") {
  auto scans = test::recorded_scans(20, 4);
  if (scans.empty()) {
    MESSAGE("skipped: DYNSLAM_DATA does not name a folder with tum/rgbd_dataset_freiburg1_xyz_first200");
    scans = test::room_scans(4, 80, 60);  // the code at least
  }
  for (const double edge : {0.05, 0.02}) {
    for (const bool discretize : {false, true}) {
      CAPTURE(edge);
      CAPTURE(discretize);
      interop::SemanticOcTree tree(edge);
      octomap::OcTree oracle(edge);
      ScanVoxels voxels(tree.grid());
      for (const auto& scan : scans) {
        gather_point_cloud(voxels, scan.points, scan.origin, 4.0, discretize);
        tree.integrate(voxels);
        octomap::Pointcloud cloud;
        for (const auto& point : scan.points) cloud.push_back(point.p.x(), point.p.y(), point.p.z());
        oracle.insertPointCloud(cloud, {scan.origin.x(), scan.origin.y(), scan.origin.z()}, 4.0, false,
                                discretize);
      }
      const auto same = test::compare_trees(tree, oracle);
      CHECK(same.first_fault == "");
      CHECK(same.largest_difference < 1e-6);
      CHECK(same.nodes >= oracle.size());
      CHECK(tree.size() > 1000);
    }
  }
}
