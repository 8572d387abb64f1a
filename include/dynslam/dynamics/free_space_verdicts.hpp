// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// What the cells of the present frame are, by earlier views.
struct FreeSpaceVerdicts {
  /// `age` of a cell that was never seen to move: older than anything.
  static constexpr float kNever = std::numeric_limits<float>::infinity();

  Image<std::uint8_t> seed;      ///< 1: moved there, or was found moving shortly before
  Image<std::uint8_t> barrier;   ///< 1: was there already, so growing must not enter
  Image<std::uint8_t> verified;  ///< the same, and stays as it is: known to be static
  Image<float> age;              ///< time since direct evidence of motion [s]; kNever: none
  /// Depth of a surface that was there shortly before and is no more, for one sees past it; 0: none [m].
  Image<float> gone;

  void resize(int width, int height) {
    for (auto* image : {&seed, &barrier, &verified}) image->resize(width, height);
    for (auto* image : {&age, &gone}) image->resize(width, height);
  }
  /// Of this size, and nothing said of any cell.
  void clear(int width, int height) {
    resize(width, height);
    for (auto* image : {&seed, &barrier, &verified}) image->fill(0);
    age.fill(kNever);
    gone.fill(0.0F);
  }
  /// A cell of which something else than its depth says that it moves now.
  void take_for_moving(int u, int v) {
    seed(u, v) = 1;
    barrier(u, v) = 0;
    age(u, v) = 0;
  }
  /// The same, where that it was there already shows nothing: a surface that slides in its own plane.
  void doubt(int u, int v) {
    take_for_moving(u, v);
    verified(u, v) = 0;
  }
};

/// Whether a cell is direct evidence of motion.
[[nodiscard]] inline bool fresh_seed(const FreeSpaceVerdicts& verdicts, int u, int v) {
  return verdicts.seed(u, v) != 0 && !(verdicts.age(u, v) > 0);
}

/// What a remembered cell was taken for.
enum CellState : std::uint8_t {
  kCellStatic = 0,
  kCellMoved = 1,     ///< by motion that was measured
  kCellSuspected = 2  ///< by an a-priori mask alone (a person may sit still)
};

/// What the cells of a frame are remembered as.
/// @param mask   what was taken for dynamic in the end, of the grid's image; of another size: nothing
/// @param moved  cells that were found by motion
/// @param state  out
template <LabelImage Mask>
void state_cells(const DepthGrid& grid, const Mask& mask, const Image<std::uint8_t>& moved,
                 Image<std::uint8_t>& state) {
  const bool usable = mask.width() == grid.image_width() && mask.height() == grid.image_height();
  state.resize(grid.width(), grid.height());
  for (std::size_t c = 0; c < grid.cells(); ++c) {
    const RecordedPixel pixel = usable ? grid.pixel_of(c) : RecordedPixel();
    const bool dynamic = pixel.u >= 0 && mask(pixel.u, pixel.v) != 0;
    state.data()[c] = !dynamic ? kCellStatic : moved.data()[c] != 0 ? kCellMoved : kCellSuspected;
  }
}

}  // namespace dynslam
