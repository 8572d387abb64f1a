// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

namespace dynslam::runtime {

/// What `dynslam synth` makes.
struct SynthOptions {
  std::uint64_t seed = 1;  ///< layout, colours, people, noise
  int frames = 150;
  std::string path =
      "halfsphere";  ///< static, xyz, rpy, halfsphere (as TUM's camera motions); loop: once around in 18 s
  /// walking; sitting (nobody walks); box (a box moves by itself); board (a large one, all texture); crowd
  /// (feet in view, hands on a counter, a chair that is pushed and pulled); empty
  std::string scenario = "walking";
  int walkers = 2;  ///< people who walk (scenarios walking and crowd, there beside the one with the chair)
  bool box = true;  ///< the first walker carries a box that no segmenter has a class for
  bool exposure_change = false;
  bool motion_blur = false;
  bool noise = true;                           ///< of colour and depth
  int blackout_from = 0, blackout_frames = 0;  ///< frames in which the lens is covered
  double fps = 30;
  /// From the first row of an image to the last [s]; 0: all rows at once. Truth is of the middle row.
  double readout_time = 0;
  /// Of the images [px]. The field of view across is that of 640x480, pixels stay square, and depth is as
  /// noisy in metres: the same camera resampled, cut off above and below where the image is wider than 4:3.
  int width = 640, height = 480;
};

/// Renders a sequence of an office with people into `out` in TUM's layout: rgb/, depth/, their lists,
/// associations.txt, groundtruth.txt (exact), camera.txt, and the truth of segmentation: label/
/// (8 bit, see Label), instance/ (16 bit), dynamic_mask/ and box_mask/ (255 = visible mover, carried or
/// moving box), synth.json. The same options give the same bytes, whatever the number of threads.
/// @param out  a new folder, or one that this function has filled or begun to fill: what it made there is
///             removed. It holds unfinished.txt until it is whole.
/// @throws UsageError for impossible options, InputError when `out` cannot be written, holds a sequence or
///         images that synthesize() did not make, or is where another process writes now
void synthesize(const SynthOptions& options, const std::filesystem::path& out,
                const std::function<void(int done, int total)>& progress = {});

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
