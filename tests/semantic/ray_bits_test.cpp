// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/ray_bits.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <set>
#include <vector>

#include "dynslam/semantic/scan_voxels.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// Voxels that traverse_ray() visits on the way to each end, and those that RayBits gives back.
template <class S>
struct Passed {
  using Point = Eigen::Matrix<S, 3, 1>;
  std::set<PackedKey> one_by_one, together;
  bool followed = false;

  Passed(RayBits& bits, const VoxelGrid& grid, const Point& origin, const std::vector<Point>& ends) {
    for (const Point& end : ends)
      traverse_ray(grid, origin, end, [&](PackedKey key) { one_by_one.insert(key); });
    followed = bits.carve<S>(grid, origin, ends);
    if (!followed) return;
    bits.drain([&](const VoxelKey& key, unsigned eight) {
      CHECK(key[0] % 8 == 0);
      for (unsigned i = 0; i < 8; ++i) {
        if ((eight >> i & 1) != 0) together.insert(pack(key) + i);
      }
    });
  }
};

}  // namespace

TEST_CASE_TEMPLATE("rays that are followed together pass the voxels that they pass alone", S, float, double) {
  using Point = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("ray bits");
  RayBits bits;  // keeps nothing from scan to scan
  const VoxelGrid grid(0.05);
  for (int scan = 0; scan < 20; ++scan) {
    CAPTURE(scan);
    const double size = rng.uniform(0.1, 5), away = scan % 4 == 0 ? 1600 : 3;  // near a side of the grid, too
    const auto along = [&] { return S(rng.uniform(-size, size)); };
    const Point origin(S(rng.uniform(-away, away)), S(rng.uniform(-away, away)), S(0.011));
    std::vector<Point> ends;
    for (int k = rng.integer(0, 300); k > 0; --k) ends.push_back(origin + Point(along(), along(), along()));
    ends.push_back(origin + Point(along(), 0, 0));  // along an axis, in a plane, nowhere
    ends.push_back(origin + Point(0, along(), along()));
    ends.push_back(origin);
    const Passed<S> passed(bits, grid, origin, ends);
    REQUIRE(passed.followed);
    CHECK(passed.together == passed.one_by_one);
  }
}

TEST_CASE("rays that end outside the grid, or begin there, are left out") {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  RayBits bits;
  const VoxelGrid grid(0.05);
  const std::vector<Eigen::Vector3f> ends{{1, 0, 0}, {1e9F, 0, 0}, {0, kNaN, 0}};
  const Passed<float> passed(bits, grid, {0.01F, 0.01F, 0.01F}, ends);
  CHECK(passed.together.size() == 20);
  CHECK(passed.together == passed.one_by_one);
  CHECK(Passed<float>(bits, grid, {kNaN, 0, 0}, ends).together.empty());
}

TEST_CASE("rays all over a box too large for bits carve a scan, too") {
  const VoxelGrid grid(0.05);
  const Eigen::Vector3d origin(0.01, 0.01, 0.01);
  const std::vector<Eigen::Vector3d> ends{{1500, 3, 2}, {-3, -1400, 2}, {2, 3, 1300}};
  RayBits bits;
  CHECK_FALSE(Passed<double>(bits, grid, origin, ends).followed);
  ScanVoxels together(grid), one_by_one(grid);
  together.carve_all<double>(origin, ends);
  for (const auto& end : ends) one_by_one.carve(origin, end);
  together.finish();
  one_by_one.finish();
  CHECK(together.misses() == one_by_one.misses());
  CHECK(together.misses() > 80000);
}
