// SPDX-License-Identifier: BSD-3-Clause
// What other programs make of the maps: one that knows OctoMap alone, as octovis does, and one with our
// header.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "dynslam/runtime/io/map_io.hpp"
#include "office.hpp"
#include "program.hpp"
#include "recorded_scans.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using interop::SemanticOcTree;
namespace fs = std::filesystem;
using test::office, test::ProgramResult, test::shell;

namespace {

ProgramResult read_by(const char* program, const fs::path& file, bool with_errors = false) {
  return shell(std::string(program) + " '" + file.string() + (with_errors ? "' 2>&1" : "' 2> /dev/null"));
}

template <class Rest>
std::string expected_lines(const SemanticOcTree& tree, const char* type, Rest&& rest) {
  std::ostringstream out;
  out.precision(17);
  out << type << ' ' << tree.getResolution() << ' ' << tree.size() << '\n';
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const octomap::OcTreeKey key = it.getKey();
    out << key[0] << ' ' << key[1] << ' ' << key[2] << ' ' << it.getDepth();
    rest(out, *it);
    out << '\n';
  }
  return out.str();
}

void put_colour(std::ostream& out, const std::array<std::uint8_t, 3>& c) {
  for (const std::uint8_t x : c) out << ' ' << int(x);
}

/// A room with a table of class chair.
SemanticOcTree labelled_room() {
  SemanticOcTree tree(0.1);
  ScanVoxels voxels(tree.grid());
  for (const auto& scan : test::room_scans(4, 80, 60)) {
    gather_point_cloud(voxels, scan.points, scan.origin, 4.0, true);
    tree.integrate(voxels);
  }
  return tree;
}

}  // namespace

TEST_CASE("a program that knows OctoMap alone opens map_color.ot of a run, every leaf and colour of it") {
  const fs::path run = office().folder.path / "first";
  const auto map = load_map(run / kMapFile);
  const ProgramResult read = read_by(DYNSLAM_OCTOMAP_READER, run / "map_color.ot");
  CHECK(read.code == 0);
  const auto colour = [](std::ostream& out, const interop::SemanticOcTreeNode& node) {
    put_colour(out, voxel_colour(node));
  };
  const bool same = read.out == expected_lines(*map, "ColorOcTree", colour);
  CHECK(same);
  // Thousands of leaves, of many colours: the office was seen.
  std::istringstream lines(read.out);
  std::string line;
  std::getline(lines, line);
  std::set<std::string> colours;
  int leaves = 0;
  for (unsigned k[4]; lines >> k[0] >> k[1] >> k[2] >> k[3] && std::getline(lines, line); ++leaves)
    colours.insert(line);
  CHECK(leaves > 1000);
  CHECK(colours.size() > 100);
}

TEST_CASE("it opens a .bt of `map export`, every leaf of it") {
  const test::TemporaryFolder folder;
  const fs::path run = office().folder.path / "first";
  const fs::path bt = folder.path / "map.bt";
  REQUIRE(test::call("map export " + (run / kMapFile).string() + " " + bt.string()).code == 0);
  const ProgramResult read = read_by(DYNSLAM_OCTOMAP_READER, bt);
  CHECK(read.code == 0);
  const bool same = read.out == expected_lines(*load_map(run / kMapFile), "OcTree",
                                               [](std::ostream&, const interop::SemanticOcTreeNode&) {});
  CHECK(same);
}

TEST_CASE("map.sot, which it cannot know, it refuses in words") {
  const ProgramResult read = read_by(DYNSLAM_OCTOMAP_READER, office().folder.path / "first" / kMapFile, true);
  CHECK(read.code == 3);
  CHECK(read.out.find("SemanticOcTree") != std::string::npos);
}

TEST_CASE(
    "a program linked against OctoMap with our header reads map.sot, and OctoMap's queries work on it") {
  const test::TemporaryFolder folder;
  const SemanticOcTree map = labelled_room();
  save_map(map, folder.path / kMapFile);
  int chairs = 0;
  const std::string expected =
      expected_lines(map, "SemanticOcTree", [&](std::ostream& out, const interop::SemanticOcTreeNode& node) {
        out << ' ' << int(node.label());
        put_colour(out, node.colour());
        chairs += node.label() == 2 ? 1 : 0;
      });
  CHECK(chairs > 20);
  const ProgramResult read = read_by(DYNSLAM_SEMANTIC_MAP_READER, folder.path / kMapFile);
  CHECK(read.code == 0);
  REQUIRE(read.out.rfind("ray ") != std::string::npos);
  const std::size_t ray = read.out.rfind("ray ");
  const bool same = read.out.substr(0, ray) == expected;
  CHECK(same);
  std::istringstream words(read.out.substr(ray + 4));
  int hit = 0;
  float x = 0, y = 0, z = 0;
  words >> hit >> x >> y >> z;
  octomap::point3d end;
  CHECK(map.castRay({0, 0, 0}, {0, 0, 1}, end, true));
  CHECK(hit == 1);
  CHECK(octomap::point3d(x, y, z) == end);
}
