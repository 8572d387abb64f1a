// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/mask_growing.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <limits>

#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/mask_upsampling.hpp"

using namespace dynslam;

namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();

/// A box of 16 x 20 cells at 1.5 m before a wall at 3 m.
struct Cells {
  Image<float> depth{80, 60, 3.0F};
  Image<std::uint8_t> last, seed{80, 60}, barrier{80, 60}, mask{80, 60};
  Image<float> age{80, 60, kNever};
  MaskGrowingWorkspace workspace;
  Cells() {
    for (int v = 20; v < 40; ++v) {
      for (int u = 30; u < 46; ++u) depth(u, v) = 1.5F;
    }
  }
  void plant(int u0, int v0, int side, float years) {
    for (int v = v0; v < v0 + side; ++v) {
      for (int u = u0; u < u0 + side; ++u) {
        seed(u, v) = 1;
        age(u, v) = years;
      }
    }
  }
  MaskGrowingResult grow(const MaskGrowingOptions& options = {}) {
    return grow_mask(depth, last, seed.view(), barrier.view(), age.view(), mask.view(), options, workspace);
  }
  [[nodiscard]] int count() const {
    return static_cast<int>(std::count(mask.data(), mask.data() + 80 * 60, std::uint8_t{255}));
  }
};

}  // namespace

TEST_CASE("a mask completes the object, within reach of fresh evidence, and passes its age on") {
  Cells cells;
  cells.plant(36, 26, 4, 0);
  MaskGrowingOptions parts;
  parts.whole = 2;
  CHECK(cells.grow(parts).seeds == 16);
  CHECK(cells.count() == 16 * 18);  // eight cells from the seeds on: two rows at the end are out of reach
  CHECK(cells.mask(30, 20) == 255);
  CHECK(cells.mask(29, 20) == 0);
  CHECK(cells.age(30, 20) == 0);
  Cells whole;
  whole.plant(36, 26, 4, 0);
  whole.grow();
  CHECK(whole.count() == 16 * 20);  // nearly all of it was found, so all of it moves

  Cells old;
  old.plant(36, 26, 4, 7);  // no fresh evidence: the seeds alone
  MaskGrowingOptions small;
  small.min_region = 1;
  old.grow(small);
  CHECK(old.count() == 16);
  CHECK(old.age(36, 26) == 7);
}

TEST_CASE("of what was masked in the image before, less evidence is enough") {
  // A board that slides in its plane: most of it is where the board was, too, and looks at rest.
  const auto found = [](int columns_masked_before) {
    Cells board;
    board.last = Image<std::uint8_t>(80, 60);
    for (int v = 20; v < 40; ++v) {
      for (int u = 30; u < 46; ++u) {
        board.barrier(u, v) = v < 27 ? 0 : 1;
        board.last(u, v) = u < 30 + columns_masked_before ? 255 : 0;
      }
    }
    board.plant(36, 21, 4, 0);
    board.grow();
    return board.count();
  };
  CHECK(found(0) == 16 * 7);
  CHECK(found(8) == 16 * 7);
  CHECK(found(14) == 16 * 20);
}

TEST_CASE("what is seen past a mover, and was taken for it once, grows old by its side") {
  Cells cells;
  cells.plant(40, 26, 5, 0);  // on the box
  cells.plant(46, 26, 4, 9);  // on the wall, beside it
  for (int v = 26; v < 29; ++v) {
    cells.seed(50, v) = 1;  // and a false one there, today
    cells.age(50, v) = 0;
  }
  cells.grow();
  REQUIRE(cells.mask(47, 32) == 255);
  CHECK(cells.age(47, 32) == 9);
  CHECK(cells.age(38, 30) == 0);
  // A hole that was filled has no evidence on its surface, and is not carried on.
  Cells ring;
  ring.depth(38, 30) = 2.5F;
  ring.plant(36, 24, 4, 0);
  ring.grow();
  CHECK(ring.mask(38, 30) == 255);
  CHECK(ring.age(38, 30) == kNever);
}

TEST_CASE("few seeds on what is behind a mover are noise, however many the mover has") {
  Cells cells;
  cells.plant(40, 26, 6, 0);  // on the box, up to its rim
  cells.plant(46, 26, 3, 0);  // and beside it on the wall
  CHECK(cells.grow().seeds == 36);
  CHECK(cells.mask(44, 30) == 255);
  CHECK(cells.mask(47, 27) == 0);
  CHECK(cells.count() == 16 * 20);
}

TEST_CASE("single seeds are noise, and a region that fills the view has leaked") {
  Cells noise;
  noise.plant(36, 26, 2, 0);
  CHECK(noise.grow().seeds == 0);
  CHECK(noise.count() == 0);

  Cells wall;
  wall.plant(4, 4, 4, 0);
  MaskGrowingOptions anywhere;
  anywhere.reach = -1;
  CHECK(wall.grow(anywhere).regions_leaked == 1);
  CHECK(wall.count() == 0);
}

TEST_CASE("a board that is carried up to the camera keeps its mask until little else is left") {
  const auto covered = [](int columns) {  // of the 80, by a board before the wall, with evidence all over it
    Cells near;
    for (int v = 0; v < 60; ++v) {
      for (int u = 0; u < columns; ++u) near.depth(u, v) = 0.6F;
    }
    near.plant(4, 4, 4, 0);
    near.plant(30, 30, 4, 0);
    MaskGrowingOptions anywhere;
    anywhere.reach = -1;
    near.grow(anywhere);
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

TEST_CASE("what only the growing reached is as old as the newest quarter of its surface's evidence") {
  for (const int fresh : {1, 4, 5, 8}) {  // of 16 seeds
    Cells cells;
    cells.plant(36, 26, 4, 300.0F);
    for (int k = 0; k < fresh; ++k) cells.age(36 + k % 4, 26 + k / 4) = 0;
    cells.grow();
    REQUIRE(cells.mask(32, 30) == 255);
    CHECK(cells.age(32, 30) == (fresh >= 4 ? 0.0F : 300.0F));
  }
}
