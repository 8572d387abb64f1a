// SPDX-License-Identifier: BSD-3-Clause
// `dynslam map` as a user calls it.
#include <doctest/doctest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "dynslam/runtime/io/map_io.hpp"
#include "program.hpp"
#include "recorded_scans.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using test::call, test::check_one_line_error, test::shell, test::ProgramResult;

namespace {

/// A table (class chair) and walls, see room_scans(); saved as map.sot.
struct SavedMap : test::TemporaryFolder {
  std::string map = (path / "map.sot").string();
  SavedMap() {
    interop::SemanticOcTree tree(0.05);
    ScanVoxels voxels(tree.grid());
    for (const auto& scan : test::room_scans(4, 160, 120)) {
      gather_point_cloud(voxels, scan.points, scan.origin, 4.0, true);
      tree.integrate(voxels);
    }
    runtime::save_map(tree, map);
  }
};

}  // namespace

TEST_CASE("map info and export") {
  const SavedMap saved;
  const ProgramResult text = call("map info " + saved.map);
  CHECK(text.code == 0);
  CHECK(text.out.find("chair") != std::string::npos);
  const auto json = nlohmann::json::parse(call("map info " + saved.map + " --json").out);
  CHECK(json["classes"]["chair"]["voxels"].get<int>() > 100);
  CHECK(json["resolution_m"] == 0.05);
  for (const char* name : {"m.sot", "c.ot", "b.bt", "p.ply", "s.txt", "s.json"}) {
    const ProgramResult r = call("map export " + saved.map + " " + (saved.path / name).string());
    CHECK(r.code == 0);
    CHECK(r.out == "");
    CHECK(std::filesystem::file_size(saved.path / name) > 100);
  }
  for (const char* colours : {"classes", "height"}) {
    const std::string picture = (saved.path / "p.png").string();
    CHECK(call("map render " + saved.map + " " + picture + " --colours " + colours).code == 0);
    CHECK(std::filesystem::file_size(picture) > 1000);
  }
}

TEST_CASE("map export makes a grid for a planner, and says on what floor") {
  const SavedMap saved;
  const std::string grid = (saved.path / "grid.pgm").string(),
                    command = "map export " + saved.map + " --grid ";
  ProgramResult r = call(command + grid + " --camera-height 1 --band 0.1 1.5 --cell 0.1");
  CHECK(r.code == 0);
  CHECK(r.out.find("cells of 0.1 m: ") != std::string::npos);
  CHECK(std::filesystem::file_size(grid) > 100);
  CHECK(std::filesystem::file_size(saved.path / "grid.yaml") > 100);
  r = call(command + grid + " " + (saved.path / "both.ply").string() + " --ignore chair --up 0 -1 0");
  CHECK(r.out.find("floor ") == 0);
  CHECK(std::filesystem::exists(saved.path / "both.ply"));
  check_one_line_error(command + (saved.path / "grid.png").string(), 2, "a grid's extension is .pgm");
  check_one_line_error(command + grid + " --band 2 1", 2, "band from a lower to a higher height");
  check_one_line_error(command + grid + " --ignore horse", 2, "no class 'horse'");
  check_one_line_error(command + grid + " --cell 0", 2, "--cell");
  check_one_line_error("map export " + saved.map + " --band 0 1", 2, "--grid");
  check_one_line_error("map export " + saved.map, 2, "needs a file to make");
}

TEST_CASE("map export makes clouds and meshes, which Open3D reads") {
  const SavedMap saved;
  const std::string folder = saved.path.string(), command = "map export " + saved.map + " ";
  const ProgramResult r = call(command + "--pointcloud " + folder + "/c.pcd --mesh " + folder + "/m.ply");
  CHECK(r.code == 0);
  CHECK(r.out.find(" triangles between occupied and free space\n") != std::string::npos);
  CHECK(call(command + "--pointcloud " + folder + "/c.ply").code == 0);
  check_one_line_error(command + "--pointcloud " + folder + "/c.xyz", 2, ".ply or .pcd");
  check_one_line_error(command + "--mesh " + folder + "/m.stl", 2, "a mesh's extension is .ply");
  check_one_line_error(command + "--mesh " + saved.map, 2, "is the map itself");

  std::filesystem::create_directory_symlink(".", saved.path / "same");
  const std::string both = folder + "/b.ply", grid = folder + "/b.pgm";
  for (const std::string& two :
       {"--pointcloud " + both + " --mesh " + folder + "/same/b.ply", both + " --mesh " + both,
        both + " --grid " + grid + " --mesh " + folder + "/b.yaml"}) {
    check_one_line_error(command + two, 2, "is named for two outputs");
    CHECK_FALSE(std::filesystem::exists(both));
  }
  REQUIRE(shell("mkfifo " + folder + "/pipe.ply").code == 0);
  check_one_line_error(command + both + " --mesh " + folder + "/pipe.ply", 1,
                       "pipe.ply: is not a regular file");
  CHECK_FALSE(std::filesystem::exists(both));

  // Debian's python3-open3d, where it is installed.
  const std::string python = "/usr/bin/python3 -c ";
  if (shell(python + "'import open3d' 2>/dev/null").code != 0) {
    MESSAGE("SKIPPED: no python3-open3d");
    return;
  }
  const std::string script =
      "\"import open3d as o, numpy as n\n"
      "for f in ('c.ply', 'c.pcd'):\n"
      "  c = o.io.read_point_cloud('" +
      folder +
      "/' + f)\n"
      "  chairs = (n.abs(n.asarray(c.colors) - [192 / 255, 0, 0]).max(1) < 1e-3).sum()\n"
      "  print(len(c.points), chairs, c.has_colors())\n"
      "m = o.io.read_triangle_mesh('" +
      folder +
      "/m.ply')\n"
      "print(len(m.triangles), m.has_vertex_colors(), m.is_edge_manifold())\"";
  const ProgramResult read = shell(python + script + " 2>&1");
  const auto classes = nlohmann::json::parse(call("map info " + saved.map + " --json").out);
  const std::string cloud = std::to_string(classes["occupied"]["voxels"].get<int>()) + " " +
                            std::to_string(classes["classes"]["chair"]["voxels"].get<int>()) + " True\n";
  const std::string triangles = r.out.substr(0, r.out.find(' '));
  CHECK(read.out == cloud + cloud + triangles + " True True\n");
}

TEST_CASE("what is made of a map without occupied voxels is told to be empty") {
  const test::TemporaryFolder folder;
  const std::string path = folder.path.string(), map = path + "/map.sot";
  interop::SemanticOcTree tree(0.05);
  runtime::save_map(tree, map);
  const std::string warning =
      "dynslam: warning: " + map + ": has no occupied voxel, so there is nothing to see in " + path;
  ProgramResult r = call("map export " + map + " " + path + "/a.ply --pointcloud " + path + "/b.pcd");
  CHECK(r.code == 0);
  CHECK(r.out == warning + "/a.ply, " + path + "/b.pcd\n");
  r = call("map render " + map + " " + path + "/a.png");
  CHECK(r.code == 0);
  CHECK(r.out == warning + "/a.png\n");
}

TEST_CASE("map query answers about points, boxes, rays and obstacles, fine and coarse") {
  const SavedMap saved;
  const auto ask = [&](const std::string& question) {
    const ProgramResult r = call("map query " + saved.map + " --json " + question);
    CAPTURE(question);
    CAPTURE(r.out);
    REQUIRE(r.code == 0);
    return nlohmann::json::parse(r.out);
  };
  // The wall ahead is at z = 2.5, the table's top at y = 0.4 around z = 1.4.
  const auto down = ask("--ray 0.1 0 1.4 0 1 0");
  CHECK(down["class"] == "chair");
  CHECK(down["distance_m"].get<double>() == doctest::Approx(0.4).epsilon(0.15));
  CHECK(ask("--ray 0.1 0 0.2 0 0 1")["class"] == "background");
  CHECK(ask("--ray 0.1 0 0.2 0 0 1 --range 1")["state"] == "free");
  CHECK(ask("--at 0.1 0 1")["state"] == "free");
  CHECK(ask("--at 90 0 1")["state"] == "unknown");
  CHECK(ask("--ray 90 0 1 1 0 0 --unknown-blocks")["state"] == "unknown");
  const auto near = ask("--nearest 0.1 0.1 1.4");
  CHECK(near["class"] == "chair");
  CHECK(near["distance_m"].get<double>() == doctest::Approx(0.28).epsilon(0.2));
  CHECK(near["edge_m"] == 0.05);
  CHECK(ask("--nearest 0.1 0.1 1.4 --cell 0.2")["edge_m"] == 0.2);
  CHECK(ask("--nearest 0.1 -0.3 1 --range 0.1")["state"] == "none");
  const auto box = ask("--box -0.5 0.3 1.1 0.5 0.5 1.7");
  CHECK(box["classes"]["chair"].get<int>() > 50);
  CHECK(ask("--box 0.5 0.5 1.7 -0.5 0.3 1.1") == box);  // any two corners
  CHECK(call("map query " + saved.map + " --at 0.1 0 1").out.find("free") == 0);
}

TEST_CASE("numbers beyond all grids are answered or refused, never free") {
  const SavedMap saved;
  const std::string query = "map query " + saved.map + " ";
  for (const char* ray :
       {"--ray 0 0 0 1e300 0 0", "--ray 1e300 0 0 1 0 0", "--ray 0 0 0 1e308 1e308 1e308"}) {
    CAPTURE(ray);
    const ProgramResult r = call(query + ray);
    CHECK(r.code == 2);
    CHECK(r.out.find("free") == std::string::npos);
  }
  CHECK(call(query + "--ray 0.1 0 0.2 0 0 1 --range 1e300").out.find("occupied") == 0);
  CHECK(call(query + "--at 1e300 0 0").out.find("unknown") == 0);
  CHECK(call(query + "--nearest 1e300 0 0").out.find("none") == 0);
}

TEST_CASE("mistakes with maps are one line and a non-zero code") {
  const SavedMap saved;
  const std::string folder = saved.path.string();
  std::ofstream(folder + "/junk.sot") << "junk";
  CHECK(call("map export " + saved.map + " " + folder + "/colour.ot").code == 0);
  check_one_line_error("map", 2, "subcommand");
  check_one_line_error("map info " + folder + "/absent.sot", 1, "absent.sot: does not exist");
  check_one_line_error("map info " + folder + "/junk.sot", 1, "junk.sot: is not an OctoMap file");
  check_one_line_error("map info " + folder + "/colour.ot", 1, "ColorOcTree");
  check_one_line_error("map export " + saved.map + " " + folder + "/no/x.ply", 1, "x.ply: cannot be written");
  check_one_line_error("map export " + saved.map + " " + folder + "/x.stl", 2, "x.stl");
  check_one_line_error("map query " + saved.map, 2, "needs a question");
  check_one_line_error("map query " + saved.map + " --at 1 2", 2, "--at");
  check_one_line_error("map query " + saved.map + " --at 1 2 nan", 2, "'nan' is not a finite number");
  check_one_line_error("map query " + saved.map + " --at 1 2 3 --nearest 1 2 3", 2, "excludes");
  check_one_line_error("map query " + saved.map + " --ray 0 0 0 0 0 0", 2, "direction is zero");
  check_one_line_error("map query " + saved.map + " --at 0 0 0 --range -1", 2, "--range");
}
