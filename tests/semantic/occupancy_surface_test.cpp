// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/occupancy_surface.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <utility>

#include "dynslam/semantic/map_voxel.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "painted_map.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A map that computes its voxels: 60 x 60 x 60 of them about the origin.
class FunctionMap {
 public:
  using Key = VoxelKey;
  using Voxel = MapVoxel;
  FunctionMap(double edge, std::function<MapVoxel(const Eigen::Vector3d&)> f)
      : grid_(edge), f_(std::move(f)) {}
  [[nodiscard]] VoxelGrid grid() const { return grid_; }
  [[nodiscard]] MapVoxel at(const VoxelKey& key, int) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (std::abs(int(key[a]) - 32768) > 30) return {};
    return f_(grid_.centre(key));
  }
  template <class F>
  void for_each_occupied(const VoxelKey&, const VoxelKey&, int, F&& f) const {
    VoxelKey key;
    for (key[2] = 32738; key[2] <= 32798; ++key[2])
      for (key[1] = 32738; key[1] <= 32798; ++key[1])
        for (key[0] = 32738; key[0] <= 32798; ++key[0])
          if (const MapVoxel voxel = at(key, 0); voxel.state == Occupancy::occupied) f(key, voxel);
  }

 private:
  VoxelGrid grid_;
  std::function<MapVoxel(const Eigen::Vector3d&)> f_;
};
static_assert(VoxelMap<FunctionMap>);

MapVoxel voxel_of(double log_odds) {
  return {log_odds >= 0 ? Occupancy::occupied : Occupancy::free, static_cast<float>(log_odds), 0, 0};
}

/// Counts of directed edges: of a closed surface each is there as often as its reverse.
std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges_of(const OccupancySurface& surface) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : surface.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  return edges;
}

double area_of(const OccupancySurface& surface) {
  double area = 0;
  for (const auto& [a, b, c] : surface.triangles) {
    const Eigen::Vector3d& p = surface.vertices[a];
    area += (surface.vertices[b] - p).cross(surface.vertices[c] - p).norm() / 2;
  }
  return area;
}

/// By the divergence theorem: above 0 where the triangles face outwards.
double volume_of(const OccupancySurface& surface) {
  double volume = 0;
  for (const auto& [a, b, c] : surface.triangles)
    volume += surface.vertices[a].dot(surface.vertices[b].cross(surface.vertices[c])) / 6;
  return volume;
}

}  // namespace

TEST_CASE("of a sphere the surface is closed, everywhere near it, and as large") {
  constexpr double kEdge = 0.05, kRadius = 1.0;
  const Eigen::Vector3d centre(0.013, -0.02, 0.007);
  const FunctionMap map(kEdge, [&](const Eigen::Vector3d& p) {
    return voxel_of(std::clamp((kRadius - (p - centre).norm()) / kEdge * 1.5, -2.0, 3.5));
  });
  const OccupancySurface surface = occupancy_surface(map);
  REQUIRE(surface.triangles.size() > 1000);
  CHECK(surface.voxels.size() == surface.vertices.size());
  for (const Eigen::Vector3d& p : surface.vertices)
    CHECK(std::abs((p - centre).norm() - kRadius) < 0.2 * kEdge);
  const auto edges = edges_of(surface);
  CHECK(std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
    const auto reverse = edges.find({edge.first.second, edge.first.first});
    return edge.second == 1 && reverse != edges.end() && reverse->second == 1;
  }));
  // Euler: a sphere has V - E + F = 2.
  CHECK(surface.vertices.size() + surface.triangles.size() == edges.size() / 2 + 2);
  CHECK(area_of(surface) == doctest::Approx(4 * std::numbers::pi).epsilon(0.01));
  CHECK(volume_of(surface) == doctest::Approx(4 * std::numbers::pi / 3).epsilon(0.01));
  for (std::size_t i = 0; i < surface.vertices.size(); i += 50) {
    const Eigen::Vector3d d = surface.vertices[i] - map.grid().centre(surface.voxels[i]);
    CHECK(d.cwiseAbs().maxCoeff() < kEdge);
    CHECK(map.at(surface.voxels[i], 0).state == Occupancy::occupied);
  }
}

TEST_CASE("a box of a fused map has its faces within a voxel and its area within a few percent") {
  VoxelBlockMap<float> map{VoxelGrid(0.05)};
  const Eigen::Vector3d half(0.8, 0.5, 0.3);
  test::paint_map(map, {-1.2, -1.2, -1.2}, {1.2, 1.2, 1.2}, [&](const Eigen::Vector3d& p) {
    return test::Paint{((p.cwiseAbs() - half).array() < 0).all() ? Occupancy::occupied : Occupancy::free, 2};
  });
  const OccupancySurface surface = occupancy_surface(map);
  for (const Eigen::Vector3d& p : surface.vertices) {
    const double outside = (p.cwiseAbs() - half).maxCoeff();
    CHECK(std::abs(outside) < 0.05);
  }
  const double area = 8 * (half.x() * half.y() + half.y() * half.z() + half.z() * half.x());
  CHECK(area_of(surface) == doctest::Approx(area).epsilon(0.05));
  CHECK(volume_of(surface) == doctest::Approx(8 * half.prod()).epsilon(0.08));
  const auto edges = edges_of(surface);
  CHECK(std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
    return edges.count({edge.first.second, edge.first.first}) == 1;
  }));
}

TEST_CASE("whatever is occupied, a surface has no holes") {
  test::Rng rng("random voxels");
  for (const double share : {0.1, 0.5, 0.9}) {
    CAPTURE(share);
    VoxelBlockMap<float> map{VoxelGrid(0.1)};
    test::paint_map(map, {-1, -1, -1}, {1, 1, 1}, [&](const Eigen::Vector3d& p) {
      const bool inner = p.cwiseAbs().maxCoeff() < 0.9;  // with free space all around
      return test::Paint{inner && rng.uniform() < share ? Occupancy::occupied : Occupancy::free};
    });
    const OccupancySurface surface = occupancy_surface(map);
    const auto edges = edges_of(surface);
    CHECK(edges.size() > 1000);
    CHECK(std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
      const auto reverse = edges.find({edge.first.second, edge.first.first});
      return reverse != edges.end() && reverse->second == edge.second;
    }));
    CHECK(volume_of(surface) > 0);
  }
}

TEST_CASE("what nobody has seen bounds nothing") {
  // A wall that was seen from one side: free before it, unknown behind, and unknown beside.
  const FunctionMap wall(0.1, [](const Eigen::Vector3d& p) {
    if (p.head<2>().cwiseAbs().maxCoeff() > 1 || p.z() > 0.1) return MapVoxel{};
    return voxel_of(p.z() > 0 ? 1.0 : -1.0);
  });
  const OccupancySurface surface = occupancy_surface(wall);
  CHECK(area_of(surface) == doctest::Approx(1.9 * 1.9).epsilon(0.001));
  for (const Eigen::Vector3d& p : surface.vertices) CHECK(p.z() == doctest::Approx(0));
  for (const auto& [a, b, c] : surface.triangles) {  // faces those who saw it
    const Eigen::Vector3d& p = surface.vertices[a];
    CHECK((surface.vertices[b] - p).cross(surface.vertices[c] - p).z() < 0);
  }
  const FunctionMap alone(0.1,
                          [](const Eigen::Vector3d& p) { return p.norm() < 0.5 ? voxel_of(1) : MapVoxel{}; });
  CHECK(occupancy_surface(alone).triangles.empty());
  CHECK(occupancy_surface(VoxelBlockMap<float>{VoxelGrid(0.1)}).vertices.empty());
}
