// SPDX-License-Identifier: BSD-3-Clause
// A camera that drives up and down the same way all day: what it has seen does not become more.
#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <vector>

#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "office.hpp"
#include "replayed_sequence.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::kNeverStop, test::office;

namespace {

struct Extent {
  int keyframes, points;
  std::uintmax_t keyframe_bytes, scan_bytes;
  std::size_t octree;  // nodes
  double occupied;     // m^3: what is seen for long is pruned to fewer nodes
};

double occupied_volume(const interop::SemanticOcTree& tree) {
  double sum = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf)
    sum += tree.isNodeOccupied(*leaf) ? std::pow(leaf.getSize(), 3) : 0;
  return sum;
}

/// What is left in a saved map.
Extent extent(const fs::path& map) {
  const LocalMap saved = load_slam_map(map, office().camera());
  const auto octree = load_map(map / "map.sot");
  return {live_keyframes(saved),
          live_points(saved),
          fs::file_size(map / "keyframes.bin"),
          fs::file_size(map / "scans.bin"),
          octree->size(),
          occupied_volume(*octree)};
}

}  // namespace

TEST_CASE("up and down the same way: keyframes, points and the saved files stop growing") {
  const test::TemporaryFolder folder;
  test::replay(office().sequence, folder.path, 480);
  std::vector<Extent> after;
  for (const std::size_t frames : {std::size_t(160), std::size_t(480)}) {
    RunOptions o = office().options("unused", frames, {}, folder.path / "map");
    o.sequence = folder.path;
    o.out = folder.path / "out";
    o.dynamics = DynamicsMode::none;
    CHECK(run_sequence(o, kNeverStop).tracked == frames);
    after.push_back(extent(folder.path / "map"));
  }
  const auto flat = [&](auto member) {
    CAPTURE(after[0].*member);
    CAPTURE(after[1].*member);
    CHECK(static_cast<double>(after[1].*member) <= 1.1 * static_cast<double>(after[0].*member));
  };
  flat(&Extent::keyframes);
  flat(&Extent::points);
  flat(&Extent::keyframe_bytes);
  flat(&Extent::scan_bytes);
  flat(&Extent::octree);
  flat(&Extent::occupied);
  CHECK(after[1].occupied > 0.9 * after[0].occupied);  // and nothing that was there is gone
}
