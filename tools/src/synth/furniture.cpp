// SPDX-License-Identifier: BSD-3-Clause
#include "synth/furniture.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

namespace dynslam::runtime::synth {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Translation3d;
using Eigen::Vector3d;

constexpr double kSide = 4.2, kBack = 4.6, kFront = -2.5, kHigh = 2.8;  // walls and ceiling [m]

/// The order of the parts is the order in which they draw from the generator. Arguments of one call are drawn
/// one statement each, as compilers differ in their order.
class Furnisher {
 public:
  Furnisher(Random& random, const Textures& textures) : r_(random), t_(textures) {}
  void make_room();
  void make_pictures();
  void make_sides();
  void make_plant();
  void make_seats(double nearer);
  void make_counter();
  void make_rear();
  [[nodiscard]] Furniture finish() { return std::move(out_); }

 private:
  void make_desk(double x, double y);
  void make_chair(double x, double y, double angle);

  Random& r_;
  const Textures& t_;
  Furniture out_;
};

void Furnisher::make_chair(double x, double y, double angle) {
  add_chair(out_.triangles, t_, at(x, y, 0, angle), {Label::chair, ++out_.instances});
}

void Furnisher::make_desk(double x, double y) {
  box(out_.triangles, at(x, y, 0.72), {1.5, 0.75, 0.04}, t_.wood, {});
  for (const double side : {-0.7, 0.7}) {
    for (const double depth : {-0.32, 0.32})
      box(out_.triangles, at(x + side, y + depth, 0.35), {0.05, 0.05, 0.7}, t_.metal, {});
  }
  const double top = 0.74;
  const int displays = r_.integer(1, 2);
  for (int k = 0; k < displays; ++k) {
    const Tag tag{Label::display, ++out_.instances};
    const double dx = x + (displays == 1 ? r_.uniform(-0.2, 0.2) : (k == 0 ? -0.32 : 0.32));
    const double dy = y + r_.uniform(0.05, 0.2);
    const Affine3d T = at(dx, dy, top, r_.uniform(-0.25, 0.25));
    box(out_.triangles, T * Translation3d(0, 0, 0.29), {0.54, 0.04, 0.34}, t_.dark, tag,
        t_.screens[static_cast<std::size_t>(r_.integer(0, 3))]);
    box(out_.triangles, T * Translation3d(0, 0.03, 0.1), {0.06, 0.03, 0.2}, t_.dark, tag);
    box(out_.triangles, T * Translation3d(0, 0.02, 0.01), {0.24, 0.18, 0.02}, t_.dark, tag);
  }
  const double kx = x + r_.uniform(-0.1, 0.1);
  box(out_.triangles, at(kx, y - 0.2, top + 0.012, r_.uniform(-0.1, 0.1)), {0.44, 0.16, 0.024}, t_.keyboard,
      {});
  for (int k = 0; k < 3; ++k) {  // mugs, books, papers
    const double cx = x + r_.uniform(-0.68, 0.68), cy = y + r_.uniform(-0.3, 0.05);
    limb(out_.triangles, {cx, cy, top + 0.03}, {cx, cy, top + 0.07}, 0.038, 0.038,
         t_.mugs[static_cast<std::size_t>(r_.integer(0, 3))], {});
    const int n = r_.integer(1, 4);
    double z = top;
    const double bx = x + r_.uniform(-0.6, 0.6), by = y + r_.uniform(-0.28, 0.2);
    for (int b = 0; b < n; ++b) {
      const double thick = r_.uniform(0.015, 0.045), yaw = r_.uniform(-0.4, 0.4);
      box(out_.triangles, at(bx, by, z + thick / 2, yaw), {0.21, 0.28, thick},
          t_.posters[static_cast<std::size_t>(r_.integer(0, 7))], {});
      z += thick;
    }
  }
}

void Furnisher::make_room() {
  const auto flat = [this](const std::array<Vector3d, 4>& corners, int texture) {
    quad(out_.triangles, corners, texture, {});
  };
  const auto wall = [&](double x0, double y0, double x1, double y1) {
    flat({Vector3d(x0, y0, 0), Vector3d(x1, y1, 0), Vector3d(x1, y1, kHigh), Vector3d(x0, y0, kHigh)},
         t_.wall);
  };
  flat({Vector3d(-kSide, kFront, 0), Vector3d(kSide, kFront, 0), Vector3d(kSide, kBack, 0),
        Vector3d(-kSide, kBack, 0)},
       t_.floor);
  flat({Vector3d(-kSide, kBack, kHigh), Vector3d(kSide, kBack, kHigh), Vector3d(kSide, kFront, kHigh),
        Vector3d(-kSide, kFront, kHigh)},
       t_.ceiling);
  wall(-kSide, kBack, kSide, kBack);
  wall(-kSide, kFront, -kSide, kBack);
  wall(kSide, kBack, kSide, kFront);
  wall(kSide, kFront, -kSide, kFront);
}

/// Posters on the back wall, and a partition behind the desks with more of them.
void Furnisher::make_pictures() {
  for (int k = 0; k < 7; ++k) {
    const double x = -3.4 + 1.05 * k + r_.uniform(-0.15, 0.15), z = r_.uniform(1.4, 1.9);
    box(out_.triangles, at(x, kBack - 0.02, z), {r_.uniform(0.4, 0.6), 0.02, r_.uniform(0.55, 0.8)}, t_.wall,
        {}, t_.posters[static_cast<std::size_t>(k)]);
  }
  box(out_.triangles, at(0, 3.25, 0.65), {4.2, 0.06, 1.3}, t_.partition, {});
  for (int k = 0; k < 4; ++k) {
    const double x = -1.6 + k + r_.uniform(-0.2, 0.2), z = 1.05 + r_.uniform(-0.08, 0.06);
    box(out_.triangles, at(x, 3.2, z), {0.3, 0.02, 0.34}, t_.partition, {},
        t_.posters[static_cast<std::size_t>(r_.integer(0, 7))]);
  }
}

/// Shelves, posters and boxes along the side walls.
void Furnisher::make_sides() {
  for (const double side : {-1.0, 1.0}) {
    const double x = side * 3.1;
    box(out_.triangles, at(x, 4.2, 0.95), {1.3, 0.5, 1.9}, t_.wood, {});
    for (int row = 0; row < 4; ++row) {
      box(out_.triangles, at(x, 3.94, 0.35 + 0.45 * row), {1.2, 0.04, 0.3}, t_.dark, {},
          t_.books[static_cast<std::size_t>(r_.integer(0, 2))]);
    }
    for (int k = 0; k < 3; ++k) {
      const double z = r_.uniform(1.3, 1.7);
      box(out_.triangles, at(side * 4.18, 0.4 + 1.1 * k, z, -side * std::numbers::pi / 2), {0.5, 0.02, 0.7},
          t_.wall, {}, t_.posters[static_cast<std::size_t>(r_.integer(0, 7))]);
    }
    const double bx = side * r_.uniform(2.4, 2.9), by = r_.uniform(2.0, 2.8);
    box(out_.triangles, at(bx, by, 0.2, r_.uniform(0, 1)), {0.5, 0.4, 0.4}, t_.carton, {});
  }
}

void Furnisher::make_plant() {
  const double px = r_.uniform(-2.6, -2.2), py = 3.0;
  limb(out_.triangles, {px, py, 0.12}, {px, py, 0.32}, 0.14, 0.17, t_.carton, {});
  for (int k = 0; k < 9; ++k) {
    const double a = r_.uniform(0, 2 * std::numbers::pi), s = r_.uniform(0.2, 0.45);
    limb(out_.triangles, {px, py, 0.45}, {px + s * std::cos(a), py + s * std::sin(a), r_.uniform(0.7, 1.25)},
         0.015, 0.05, t_.leaf, {});
  }
}

/// Desks, the lamps above them, and chairs. @param nearer  to the desks than usual [m]
void Furnisher::make_seats(double nearer) {
  for (const double x : {-1.65, 0.0, 1.65}) {
    const double dx = x + r_.uniform(-0.05, 0.05);
    make_desk(dx, 2.6 + r_.uniform(-0.05, 0.05));
  }
  for (const double x : {-2.0, 2.0})
    box(out_.triangles, at(x, 1.5, kHigh - 0.04), {0.3, 1.4, 0.06}, t_.ceiling, {});
  for (const double left : {-1.7, 0.2}) {
    const double x = left + r_.uniform(0, 0.3), y = nearer + r_.uniform(1.75, 1.95);
    make_chair(x, y, r_.uniform(-0.6, 0.6));
  }
  out_.sitter_x = r_.uniform(1.45, 1.7);
  out_.sitter_y = nearer + r_.uniform(1.75, 1.9);
  make_chair(out_.sitter_x, out_.sitter_y, 0.0);
}

void Furnisher::make_counter() {
  const Eigen::AlignedBox3d& c = out_.counter = {Vector3d(-1.02, 1.66, 0.0), Vector3d(-0.12, 2.1, 0.95)};
  const Vector3d middle = c.center(), size = c.sizes();
  box(out_.triangles, at(middle.x(), middle.y(), c.max().z() - 0.02), {size.x(), size.y(), 0.04}, t_.wood,
      {});
  box(out_.triangles, at(middle.x(), middle.y() + 0.02, middle.z() - 0.02),
      {size.x() - 0.06, size.y() - 0.06, size.z() - 0.04}, t_.wood, {}, t_.books[0]);
}

/// The side behind the usual cameras: pictures, a long shelf with books, boxes.
void Furnisher::make_rear() {
  for (int k = 0; k < 8; ++k) {
    const double x = -3.6 + 1.03 * k + r_.uniform(-0.15, 0.15), z = r_.uniform(1.4, 1.9);
    box(out_.triangles, at(x, kFront + 0.02, z, std::numbers::pi),
        {r_.uniform(0.4, 0.6), 0.02, r_.uniform(0.5, 0.8)}, t_.wall, {},
        t_.posters[static_cast<std::size_t>(k % 8)]);
  }
  for (const double x : {-2.2, 0.3, 2.4}) {
    box(out_.triangles, at(x, kFront + 0.2, 0.45), {1.2, 0.36, 0.9}, t_.wood, {});
    box(out_.triangles, at(x, kFront + 0.39, 0.5, std::numbers::pi), {1.1, 0.03, 0.5}, t_.dark, {},
        t_.books[static_cast<std::size_t>(r_.integer(0, 2))]);
    const double yaw = r_.uniform(0, 1);
    box(out_.triangles, at(x + r_.uniform(-0.3, 0.3), kFront + 0.2, 1.02, yaw), {0.3, 0.2, 0.24}, t_.carton,
        {});
  }
  for (const double side : {-1.0, 1.0}) {
    for (int k = 0; k < 3; ++k) {
      const int picture = t_.posters[static_cast<std::size_t>(r_.integer(0, 7))];
      box(out_.triangles, at(side * 4.18, -1.9 + 0.8 * k, r_.uniform(1.3, 1.8), -side * std::numbers::pi / 2),
          {0.5, 0.02, 0.7}, t_.wall, {}, picture);
    }
    const double yaw = r_.uniform(0, 1);
    box(out_.triangles, at(side * 3.6, r_.uniform(-1.5, -0.5), 0.3, yaw), {0.6, 0.5, 0.6}, t_.carton, {});
  }
}

}  // namespace

void add_chair(std::vector<Triangle>& out, const Textures& textures, const Affine3d& T, const Tag& tag) {
  box(out, T * Translation3d(0, 0, 0.46), {0.46, 0.44, 0.07}, textures.cloth, tag);
  box(out, T * Translation3d(0, -0.22, 0.78) * AngleAxisd(0.12, Vector3d::UnitX()), {0.42, 0.05, 0.46},
      textures.cloth, tag);
  limb(out, T * Vector3d(0, 0, 0.12), T * Vector3d(0, 0, 0.42), 0.025, 0.025, textures.dark, tag);
  limb(out, T * Vector3d(0, -0.2, 0.46), T * Vector3d(0, -0.22, 0.6), 0.02, 0.02, textures.dark, tag);
  for (int k = 0; k < 5; ++k) {
    const double a = 2 * std::numbers::pi * k / 5;
    limb(out, T * Vector3d(0, 0, 0.1), T * Vector3d(0.28 * std::cos(a), 0.28 * std::sin(a), 0.05), 0.025,
         0.02, textures.dark, tag);
  }
}

Furniture furnish(Random& random, const Textures& textures, const FurnishOptions& options) {
  Furnisher furnisher(random, textures);
  furnisher.make_room();
  furnisher.make_pictures();
  furnisher.make_sides();
  furnisher.make_plant();
  furnisher.make_seats(options.aisle ? 0.22 : 0.0);
  if (options.aisle) furnisher.make_counter();
  if (options.all_around) furnisher.make_rear();
  return furnisher.finish();
}

}  // namespace dynslam::runtime::synth
