// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/map_leftovers.hpp"

#include <doctest/doctest.h>

#include <fstream>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "error_text.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

/// A wall 1.5 m away, all of it in a map of 4 cm, seen from one place; its right half is called dynamic in
/// frame 0.
struct HalfDynamicWall {
  test::TumFixture sequence;
  test::TemporaryFolder run;
  interop::SemanticOcTree tree{0.04};

  explicit HalfDynamicWall(int frames) : sequence(frames) {
    std::filesystem::create_directories(sequence.path / "dynamic_mask");
    std::ofstream trajectory(run.path / "trajectory.txt");
    for (const FrameRecord& frame : load_sequence(sequence.path).frames) {
      cv::Mat mask(64, 64, CV_8UC1, cv::Scalar(0));
      if (frame.stamp.front() == '1' && frame.t_rgb < 1.01) mask.colRange(32, 64).setTo(255);
      write_image(sequence.path / "dynamic_mask" / (frame.stamp + ".png"), mask);
      trajectory << frame.stamp << " 0 0 0 0 0 0 1\n";
    }
    for (int x = -30; x < 30; ++x) {
      for (int y = -30; y < 30; ++y) update(0.04 * x + 0.02, 0.04 * y + 0.02, true);
    }
  }
  void update(double x, double y, bool occupied) {
    for (int i = 0; i < 10; ++i) tree.updateNode(octomap::point3d(float(x), float(y), 1.5F), occupied);
  }
  MapLeftovers leftovers() {
    save_map(tree, run.path / kMapFile);
    return map_leftovers(run.path, sequence.path);
  }
};

}  // namespace

TEST_CASE("voxels of dynamic pixels that no static one lies in are left over") {
  HalfDynamicWall wall(1);
  // Every second pixel of 64 is 5 cm beside its neighbour, each in a voxel of 4 cm of its own.
  CHECK(wall.leftovers().voxels == 16 * 32);
  CHECK(wall.leftovers().edge == doctest::Approx(0.04));
  wall.update(0.06, 0.06, false);
  CHECK(wall.leftovers().voxels == 16 * 32 - 1);
}

TEST_CASE("a voxel that was seen static is none") {
  HalfDynamicWall wall(2);
  const MapLeftovers found = wall.leftovers();
  CHECK(found.frames == 2);
  CHECK(found.voxels == 0);
}

TEST_CASE("without true masks the error names their folder") {
  HalfDynamicWall wall(1);
  std::filesystem::remove_all(wall.sequence.path / "dynamic_mask");
  CHECK(test::mentions(test::error_of([&] { (void)wall.leftovers(); }), "dynamic_mask"));
}

TEST_CASE("true masks of other frames tell nothing of the map, which is an error") {
  HalfDynamicWall wall(1);
  const std::filesystem::path masks = wall.sequence.path / "dynamic_mask";
  std::filesystem::rename(masks / "1.000000.png", masks / "7.png");
  const std::string error = test::error_of([&] { (void)wall.leftovers(); });
  CHECK(test::mentions(error, "dynamic_mask: has no mask of a frame with a pose in "));
  CHECK(test::mentions(error, "1.000000.png and the like are looked for"));
}
