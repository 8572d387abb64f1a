// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/mask_growing.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>

#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/mask_upsampling.hpp"

using namespace dynslam;

namespace {

/// A box of 16 x 20 cells at 1.5 m before a wall at 3 m.
struct Cells {
  Image<float> depth{80, 60, 3.0F};
  Image<std::uint8_t> seed{80, 60}, barrier{80, 60}, mask{80, 60};
  MaskGrowingWorkspace workspace;
  Cells() {
    for (int v = 20; v < 40; ++v) {
      for (int u = 30; u < 46; ++u) depth(u, v) = 1.5F;
    }
  }
  void plant(int u0, int v0, int side) {
    for (int v = v0; v < v0 + side; ++v) {
      for (int u = u0; u < u0 + side; ++u) seed(u, v) = 1;
    }
  }
  MaskGrowingResult grow(const MaskGrowingOptions& options = {}) {
    return grow_mask(depth, seed.view(), barrier.view(), mask.view(), options, workspace);
  }
  [[nodiscard]] int count() const {
    return static_cast<int>(std::count(mask.data(), mask.data() + 80 * 60, std::uint8_t{255}));
  }
};

}  // namespace

TEST_CASE("a region fills its object up to the barrier, holes included") {
  Cells cells;
  cells.plant(36, 26, 4);
  cells.depth(38, 32) = 2.5F;
  CHECK(cells.grow().seeds == 16);
  CHECK(cells.count() == 16 * 20);
  CHECK(cells.mask(30, 20) == 255);
  CHECK(cells.mask(29, 20) == 0);
  CHECK(cells.mask(38, 32) == 255);
  Cells barred;
  barred.plant(36, 26, 4);
  for (int u = 30; u < 46; ++u) barred.barrier(u, 31) = 1;
  barred.grow();
  CHECK(barred.count() == 16 * 11);
}

TEST_CASE("few seeds on what is behind a mover are noise, however many the mover has") {
  Cells cells;
  cells.plant(40, 26, 6);  // on the box, up to its rim
  cells.plant(46, 26, 3);  // and beside it on the wall
  CHECK(cells.grow().seeds == 36);
  CHECK(cells.mask(44, 30) == 255);
  CHECK(cells.mask(47, 27) == 0);
  CHECK(cells.count() == 16 * 20);
}

TEST_CASE("single seeds are noise, and a region that fills the view has leaked") {
  Cells noise;
  noise.plant(36, 26, 2);
  CHECK(noise.grow().seeds == 0);
  CHECK(noise.count() == 0);

  Cells wall;
  wall.plant(4, 4, 4);
  CHECK(wall.grow().regions_leaked == 1);
  CHECK(wall.count() == 0);
}

TEST_CASE("a board that is carried up to the camera keeps its mask until little else is left") {
  const auto covered = [](int columns) {  // of the 80, by a board before the wall, with evidence all over it
    Cells near;
    for (int v = 0; v < 60; ++v) {
      for (int u = 0; u < columns; ++u) near.depth(u, v) = 0.6F;
    }
    near.plant(4, 4, 4);
    near.plant(30, 30, 4);
    near.grow();
    return near.count();
  };
  CHECK(covered(50) == 50 * 60);
  CHECK(covered(60) == 60 * 60);  // three quarters of the view, as a board at arm's length takes
  CHECK(covered(70) == 70 * 60);
  CHECK(covered(76) == 0);
}

TEST_CASE("an enlarged mask follows the outline that the pixels' depth shows") {
  const DepthGrid grid(Pinhole<double>(200, 200, 79.5, 59.5), 160, 120, {.columns = 40});
  Image<float> depth(160, 120, 3.0F);
  Image<std::uint8_t> truth(160, 120), mask(160, 120), cells, smooth, zone;
  for (int v = 33; v < 87; ++v) {
    for (int u = 50; u < 101; ++u) {
      depth(u, v) = 1.5F;
      truth(u, v) = 255;
    }
  }
  Image<float> reduced;
  grid.reduce(depth, reduced, smooth);
  cells.resize(grid.width(), grid.height());
  for (std::size_t c = 0; c < grid.cells(); ++c) cells.data()[c] = reduced.data()[c] < 2 ? 1 : 0;
  upsample_mask(cells.view(), reduced, depth, grid, mask.view(), zone);
  CHECK(std::equal(mask.data(), mask.data() + 160 * 120, truth.data()));
  cells.fill(0);
  upsample_mask(cells.view(), reduced, depth, grid, mask.view(), zone);
  CHECK(std::count(mask.data(), mask.data() + 160 * 120, std::uint8_t{0}) == 160 * 120);
}
