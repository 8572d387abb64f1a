// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/support_planes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/segment/growing_criteria.hpp"

using namespace dynslam;

namespace {

constexpr int kW = 160, kH = 120;
const Pinhole<float> kCamera(135.0F, 135.0F, 79.5F, 59.5F);

/// Depth of a floor 1.4 m below a camera that looks down by 25 degrees, and of a box of this size that stands on it 2.5 m
/// ahead. By the intersection of each ray with the planes.
struct Room {
  Image<float> depth{kW, kH, 0.0F};
  Image<float> above{kW, kH, 0.0F};  // what is seen, above the floor [m]

  Room(double width, double height, bool floor = true) {
    const double c = std::cos(0.436), s = std::sin(0.436);
    for (int v = 0; v < kH; ++v) {
      for (int u = 0; u < kW; ++u) {
        const double x = (u - 79.5) / 135, y = (v - 59.5) / 135;
        const double down = c * y + s, ahead = c - s * y;  // of the ray, by z
        const double to_floor = down > 0.01 ? 1.4 / down : 1e9, to_box = 2.5 / ahead;
        const double box_height = 1.4 - to_box * down;
        if (std::abs(to_box * x) < width / 2 && box_height > 0 && box_height < height) {
          depth(u, v) = static_cast<float>(to_box);
          above(u, v) = static_cast<float>(box_height);
        } else if (floor && to_floor < 6) {
          depth(u, v) = static_cast<float>(to_floor);
        }
      }
    }
  }
};

Image<int> planes_of(const Room& room, const SupportPlaneOptions& options = {}) {
  Image<int> plane;
  SupportPlaneWorkspace workspace;
  split_supports(kCamera, room.depth, RelativeStep<float>{0.03F, 0.01F}, options, plane, workspace);
  return plane;
}

}  // namespace

TEST_CASE("an object on a floor is not on its plane, though depth is continuous there") {
  const Room room(0.5, 1.2);
  const Image<int> plane = planes_of(room);
  int floor = 0, on_plane = 0, box = 0, taken = 0;
  for (int v = 0; v < kH; ++v) {
    for (int u = 0; u < kW; ++u) {
      if (room.depth(u, v) == 0) {
        CHECK(plane(u, v) == 0);
      } else if (room.above(u, v) == 0) {
        ++floor;
        on_plane += plane(u, v) == 1 ? 1 : 0;
      } else if (room.above(u, v) > 0.2F) {
        ++box;
        taken += plane(u, v) != 0 ? 1 : 0;
      }
    }
  }
  REQUIRE(floor > 5000);
  REQUIRE(box > 800);
  CHECK(on_plane > 0.99 * floor);
  CHECK(taken == 0);
}

TEST_CASE("a plane that is no larger than a person is no support") {
  const Room board(0.7, 1.2, false);  // 0.84 m^2
  const Image<int> plane = planes_of(board);
  for (int v = 0; v < kH; ++v) {
    for (int u = 0; u < kW; ++u) CHECK(plane(u, v) == 0);
  }
  SupportPlaneOptions smaller;
  smaller.area = 0.4;
  CHECK(planes_of(board, smaller)(80, 40) == 1);
}

TEST_CASE("the same image has the same planes every time, and one without depth has none") {
  const Room room(0.5, 1.2);
  const Image<int> once = planes_of(room), twice = planes_of(room);
  CHECK(std::equal(once.data(), once.data() + kW * kH, twice.data()));
  const Image<int> none = planes_of(Room(0.0, 0.0, false));
  for (int v = 0; v < kH; ++v) {
    for (int u = 0; u < kW; ++u) CHECK(none(u, v) == 0);
  }
}
