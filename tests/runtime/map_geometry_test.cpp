// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_geometry.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <tuple>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "error_text.hpp"
#include "painted_map.hpp"
#include "point_files.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;

namespace {

/// A chair's block, 0.8 m wide, beside a small one without a label, in free space; seen so often that it is
/// pruned.
void paint_blocks(interop::SemanticOcTree& tree) {
  for (int scan = 0; scan < 10; ++scan) {
    test::paint_map(tree, {-1, -1, -1}, {1.4, 1, 1}, [](const Eigen::Vector3d& p) -> test::Paint {
      if (p.cwiseAbs().maxCoeff() < 0.4) return {Occupancy::occupied, 2};
      if ((p - Eigen::Vector3d(1, 0, 0)).cwiseAbs().maxCoeff() < 0.1) return {Occupancy::occupied, 0};
      return {Occupancy::free};
    });
  }
}

bool has_line(const std::vector<std::string>& lines, const std::string& line) {
  return std::find(lines.begin(), lines.end(), line) != lines.end();
}

}  // namespace

TEST_CASE("a point cloud has each occupied voxel once, at its centre, with colour and label") {
  const test::TemporaryFolder folder;
  interop::SemanticOcTree tree(0.05);
  paint_blocks(tree);
  CHECK(tree.getNumLeafNodes() < 10000);  // of 80000 voxels: some are pruned
  runtime::MapClasses classes;
  CHECK(classes.add("pallet") == 4);
  const std::string ply = (folder.path / "c.ply").string(), pcd = (folder.path / "c.pcd").string();
  runtime::save_point_cloud(tree, ply, classes);
  runtime::save_point_cloud(tree, pcd, classes);
  for (const test::PointFile& file : {test::read_ply(ply), test::read_pcd(pcd)}) {
    CHECK(has_line(file.comments, "label 2 chair"));
    CHECK(has_line(file.comments, "label 4 pallet"));
    REQUIRE(file.size() == 16 * 16 * 16 + 4 * 4 * 4);
    std::map<std::tuple<int, int, int>, int> seen;
    for (std::size_t i = 0; i < file.size(); ++i) {
      const Eigen::Vector3d p(file.columns.at("x")[i], file.columns.at("y")[i], file.columns.at("z")[i]);
      const Eigen::Vector3d cell = p / 0.05;
      for (int a = 0; a < 3; ++a)  // a centre: 0.5, 1.5, ... edges
        CHECK(std::abs(cell(a) - std::floor(cell(a)) - 0.5) < 1e-4);
      ++seen[{int(std::floor(cell.x())), int(std::floor(cell.y())), int(std::floor(cell.z()))}];
      const bool chair = p.cwiseAbs().maxCoeff() < 0.4;
      CHECK((chair || (p - Eigen::Vector3d(1, 0, 0)).cwiseAbs().maxCoeff() < 0.1));
      CHECK(file.columns.at("label")[i] == (chair ? 2 : 0));
      const std::array<double, 3> rgb{file.columns.at("red")[i], file.columns.at("green")[i],
                                      file.columns.at("blue")[i]};
      CHECK(rgb == (chair ? std::array<double, 3>{192, 0, 0} : std::array<double, 3>{200, 100, 50}));
    }
    CHECK(seen.size() == file.size());
  }
}

TEST_CASE("a mesh is closed, lies within a voxel of what is there, and has its colours and labels") {
  const test::TemporaryFolder folder;
  interop::SemanticOcTree tree(0.05);
  paint_blocks(tree);
  const std::string ply = (folder.path / "m.ply").string();
  const std::size_t triangles = runtime::save_mesh(tree, ply);
  const test::PointFile file = test::read_ply(ply);
  REQUIRE(file.triangles.size() == triangles);
  REQUIRE(triangles > 1000);
  std::map<std::pair<int, int>, int> edges;
  double area = 0;
  const auto point = [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    return Eigen::Vector3d(file.columns.at("x").at(k), file.columns.at("y").at(k),
                           file.columns.at("z").at(k));
  };
  for (const auto& t : file.triangles) {
    for (std::size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
    area += (point(t[1]) - point(t[0])).cross(point(t[2]) - point(t[0])).norm() / 2;
  }
  CHECK(std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
    return edge.second == 1 && edges.count({edge.first.second, edge.first.first}) == 1;
  }));
  CHECK(area == doctest::Approx(6 * 0.8 * 0.8 + 6 * 0.2 * 0.2).epsilon(0.1));
  for (std::size_t i = 0; i < file.size(); ++i) {
    const Eigen::Vector3d p = point(static_cast<int>(i));
    const bool chair = p.x() < 0.7;
    const double outside =
        chair ? p.cwiseAbs().maxCoeff() - 0.4 : (p - Eigen::Vector3d(1, 0, 0)).cwiseAbs().maxCoeff() - 0.1;
    CHECK(std::abs(outside) < 0.05);
    CHECK(file.columns.at("label")[i] == (chair ? 2 : 0));
    CHECK(file.columns.at("red")[i] == (chair ? 192 : 200));
  }
}

TEST_CASE("clouds and meshes that cannot be written say why") {
  const interop::SemanticOcTree tree(0.05);
  CHECK_THROWS_WITH_AS(runtime::save_point_cloud(tree, "c.xyz"),
                       "'c.xyz': a point cloud's extension is .ply or .pcd", runtime::UsageError);
  CHECK_THROWS_WITH_AS((void)runtime::save_mesh(tree, "m.stl"), "'m.stl': a mesh's extension is .ply",
                       runtime::UsageError);
  CHECK(test::mentions(test::error_of([&] { runtime::save_point_cloud(tree, "/absent/c.pcd"); }), "c.pcd"));
  CHECK(test::mentions(test::error_of([&] { (void)runtime::save_mesh(tree, "/absent/m.ply"); }), "m.ply"));
}
