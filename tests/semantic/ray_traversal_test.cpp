// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/ray_traversal.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>
#include <vector>

#include "dynslam/semantic/ray_bits.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

int faces_between(const VoxelKey& a, const VoxelKey& b) {
  return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]);
}

/// How much of a segment lies in a voxel, as a share of its length by the slab method in units of voxels;
/// below 0 by how far it passes beside it.
template <class S>
double share_in(const VoxelGrid& grid, const VoxelKey& key, const Eigen::Matrix<S, 3, 1>& a,
                const Eigen::Matrix<S, 3, 1>& b) {
  double enter = 0, leave = 1;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double low = int(key[static_cast<std::size_t>(i)]) - 32768, from = double(a(i)) / grid.resolution(),
                 along = double(b(i)) / grid.resolution() - from;
    if (along == 0) {
      if (from < low || from > low + 1) return -1;
      continue;
    }
    const double s = (low - from) / along, t = (low + 1 - from) / along;
    enter = std::max(enter, std::min(s, t));
    leave = std::min(leave, std::max(s, t));
  }
  return leave - enter;
}

/// Whether a point lies in a voxel or on its faces.
template <class S>
bool touches(const VoxelGrid& grid, const VoxelKey& key, const Eigen::Matrix<S, 3, 1>& p) {
  const double rounding = 16 * double(std::numeric_limits<S>::epsilon()) * double(p.cwiseAbs().maxCoeff());
  return ((p.template cast<double>() - grid.centre(key)).cwiseAbs().array() <=
          grid.resolution() / 2 + rounding)
      .all();
}

/// Follows a segment and compares with every voxel of the box around it.
template <class S>
void check_against_every_voxel(const VoxelGrid& grid, const Eigen::Matrix<S, 3, 1>& a,
                               const Eigen::Matrix<S, 3, 1>& b) {
  CAPTURE(grid.resolution());
  CAPTURE(a.transpose());
  CAPTURE(b.transpose());
  const auto first = grid.key(a), last = grid.key(b);
  REQUIRE(first);
  REQUIRE(last);
  const int most = faces_between(*first, *last) + 3;
  std::vector<VoxelKey> visited;
  REQUIRE(traverse_ray(grid, a, b, [&](PackedKey key) {
    visited.push_back(unpack(key));
    return static_cast<int>(visited.size()) <= most;
  }));
  REQUIRE(static_cast<int>(visited.size()) <= most);
  if (*first == *last) {
    CHECK(visited.empty());
    return;
  }
  CHECK(visited.front() == *first);
  const double size = std::max(double(a.cwiseAbs().maxCoeff()), double(b.cwiseAbs().maxCoeff())),
               length = (b.template cast<double>() / size - a.template cast<double>() / size).norm(),
               rounding = 16 * double(std::numeric_limits<S>::epsilon()) / length;
  for (const VoxelKey& key : visited) CHECK(share_in(grid, key, a, b) >= -rounding);
  VoxelKey key;
  for (key[0] = std::min((*first)[0], (*last)[0]); key[0] <= std::max((*first)[0], (*last)[0]); ++key[0]) {
    for (key[1] = std::min((*first)[1], (*last)[1]); key[1] <= std::max((*first)[1], (*last)[1]); ++key[1]) {
      for (key[2] = std::min((*first)[2], (*last)[2]); key[2] <= std::max((*first)[2], (*last)[2]);
           ++key[2]) {
        if (key == *last || share_in(grid, key, a, b) <= rounding) continue;
        // OctoMap's way: of an end on a face rounding may have the length end the ray before the last voxel.
        if (touches(grid, key, b)) continue;
        CHECK(std::find(visited.begin(), visited.end(), key) != visited.end());
      }
    }
  }
}

template <class S>
double smallest_length() {
  return double(std::numeric_limits<S>::denorm_min());
}

}  // namespace

TEST_CASE_TEMPLATE("a ray of any length passes the voxels that it cuts", S, float, double) {
  using Point = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("ray of any length");
  const VoxelGrid grid(0.05);
  // Through the corner of eight voxels, where the shortest ray has a way.
  for (double length = 0.3; length > 0; length = length > smallest_length<S>() ? length * 1e-3 : 0) {
    length = std::max(length, smallest_length<S>());
    for (int k = 0; k < 8; ++k) {
      const auto along = [&] { return static_cast<S>(length * (k == 0 ? 1.0 : rng.uniform(-1, 1))); };
      const Point half(along(), along(), along());
      check_against_every_voxel<S>(grid, -half, half);
      check_against_every_voxel<S>(grid, Point::Zero(), half);
      check_against_every_voxel<S>(grid, half, Point::Zero());
    }
    const S l = static_cast<S>(length);
    for (int axis = 0; axis < 3; ++axis)
      check_against_every_voxel<S>(grid, -l * Point::Unit(axis), Point::Zero());
  }
}

TEST_CASE_TEMPLATE("the same from a voxel's face, along axes, in planes and near the grid's border", S, float,
                   double) {
  using Point = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("ray from a face");
  const VoxelGrid grid(0.125);  // faces are numbers of either type
  for (int k = 0; k < 400; ++k) {
    const double away = k % 4 == 0 ? 4090 : 2;
    Point a, b;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double from = rng.uniform(-away, away);
      a(i) = static_cast<S>(rng.integer(0, 2) == 0 ? std::round(8 * from) / 8 : from);
      b(i) = rng.integer(0, 2) == 0 ? a(i) : static_cast<S>(double(a(i)) + rng.uniform(-1, 1));
    }
    check_against_every_voxel<S>(grid, a, b);
  }
}

TEST_CASE_TEMPLATE("the same on grids of tiny and of huge voxels", S, float, double) {
  using Point = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("ray on any grid");
  const double most = double(std::numeric_limits<S>::max()), least = double(std::numeric_limits<S>::min());
  for (const double edge : {least, 1e-25, 1e-20, 1e-12, 1e12, 1e20, 1e30, most / 100}) {
    const VoxelGrid grid(edge);
    for (int k = 0; k < 20; ++k) {
      const auto along = [&] { return static_cast<S>(4 * edge * rng.uniform(-1, 1)); };
      check_against_every_voxel<S>(grid, Point(along(), along(), along()), Point(along(), along(), along()));
    }
  }
}

TEST_CASE_TEMPLATE("a ray from or to infinity, NaN or beyond the grid visits nothing", S, float, double) {
  using Point = Eigen::Matrix<S, 3, 1>;
  const VoxelGrid grid(0.05);
  int visits = 0;
  for (const S bad : {std::numeric_limits<S>::infinity(), -std::numeric_limits<S>::infinity(),
                      std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::max(), S(1639)}) {
    for (int axis = 0; axis < 3; ++axis) {
      Point p(S(0.01), S(0.02), S(0.03));
      p(axis) = bad;
      CHECK_FALSE(traverse_ray(grid, Point(0, 0, 0), p, [&](PackedKey) { return ++visits < 100; }));
      CHECK_FALSE(traverse_ray(grid, p, Point(0, 0, 0), [&](PackedKey) { return ++visits < 100; }));
    }
  }
  CHECK(visits == 0);
}

TEST_CASE_TEMPLATE("rays of any length that are followed together end, too, and pass the same voxels", S,
                   float, double) {
  using Point = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("short rays together");
  const VoxelGrid grid(0.05);
  RayBits bits;
  for (const double start : {0.0, -1e-30, -1e-24, -1e-12}) {
    const Point origin = Point::Constant(static_cast<S>(start));
    std::vector<Point> ends;
    for (double length = 1; length > smallest_length<S>(); length *= 0.1) {
      ends.push_back(Point::Constant(static_cast<S>(length)));
      const auto along = [&] { return static_cast<S>(length * rng.uniform(-1, 1)); };
      for (int k = 0; k < 3; ++k) ends.push_back(origin + Point(along(), along(), along()));
    }
    std::set<PackedKey> alone, together;
    for (const Point& end : ends) traverse_ray(grid, origin, end, [&](PackedKey key) { alone.insert(key); });
    REQUIRE(bits.carve<S>(grid, origin, ends));
    bits.drain([&](const VoxelKey& key, unsigned eight) {
      for (unsigned i = 0; i < 8; ++i) {
        if ((eight >> i & 1) != 0) together.insert(pack(key) + i);
      }
    });
    CHECK(together == alone);
  }
}
