// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/live.hpp"
#include "dynslam/runtime/nets/segmentation_stage.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/tracker.hpp"

namespace dynslam::runtime {

/// What `dynslam run` does (run_sequence()); a configuration file names its fields.
struct RunOptions {
  std::filesystem::path sequence, out;
  std::string camera;                  ///< fr1, fr2, fr3, bonn or a file; empty: from the sequence
  std::optional<double> readout_time;  ///< in place of the camera's [s], 0: all rows at once; empty: its own
  std::string format;  ///< of the sequence, see sequence_formats(); empty: by looking at the folder
  std::string topics;  ///< of a bag, "COLOUR,DEPTH"; empty: by looking at it
  double rate = 30;    ///< frames per second, of formats without time stamps
  DynamicsMode dynamics = DynamicsMode::both;
  std::filesystem::path masks;            ///< folder of a-priori masks; empty: none
  std::vector<std::string> mask_labels;   ///< what their values mean, see MaskOptions::labels
  SegmentationStageOptions segmentation;  ///< used where its model is set; not together with `masks`
  bool save_masks = false;
  bool verbose = false;          ///< for who prints the summary: what was recognised, too
  bool report = false;           ///< record what write_report() shows beside the other files: report.jsonl
  bool map = true;               ///< build and save map.sot
  double map_resolution = 0.05;  ///< metres
  std::size_t map_memory = std::size_t(2)
                           << 30;  ///< bytes that the octree may take; a run that needs more fails
  std::filesystem::path load_map;  ///< folder of an earlier run's map, to go on in; empty: a new one
  std::filesystem::path save_map;  ///< folder to save the map in; empty: not saved
  std::size_t max_frames = 0;      ///< 0: all
  std::uint64_t seed = 1;          ///< of every random choice
  double save_every = 5.0;  ///< seconds after which the trajectory and the summary so far are written again
  /// Share of the frames that may be broken; a run with more fails, its results written. Half: a sequence
  /// that is mostly damaged is not what was meant, whatever can be made of the rest.
  double max_broken = 0.5;
  /// Live: frames come at the pace at which they were recorded, those too many are dropped, and a network's
  /// masks come late. The results are then not the same in every run.
  Schedule schedule = Schedule::deterministic;
  double live_speed = 1;         ///< of that pace: 2 is twice as fast
  double live_gap = 10;          ///< between two frames [s]: a longer one is not waited for, but said
  LiveOptions live;              ///< its functions are not used
  NewMapOptions new_map;         ///< what a loss that lasts begins
  TrajectoryOptions trajectory;  ///< how trajectory.txt is smoothed
  TrackerOptions tracker;        ///< its `dynamics` is set from the one above
  /// How the octree is made; its `resolution` and `max_bytes` are set from those above.
  SemanticMapperOptions mapper = SemanticMapperOptions::of_run();
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
