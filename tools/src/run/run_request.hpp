// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/slam.hpp"

namespace dynslam::runtime {

[[nodiscard]] bool uses_network(const RunOptions& options);
/// How its mask files are read.
[[nodiscard]] MaskOptions mask_options(const RunOptions& options);
/// Names of the labels of its map: those of the map that it goes on in, then its own.
[[nodiscard]] MapClasses map_classes(const RunOptions& options);
/// The system that a run is made with.
[[nodiscard]] SlamOptions slam_options(const RunOptions& options);

/// @throws InputError where the folder of masks has none of any frame: the wrong one, most likely
void check_masks_are_there(const RunOptions& options, const Sequence& sequence);
/// @throws UsageError where a result in --out would replace what the run reads
void check_inputs_stay(const RunOptions& options, const Sequence& sequence);

}  // namespace dynslam::runtime
