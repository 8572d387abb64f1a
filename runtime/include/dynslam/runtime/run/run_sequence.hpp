// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/live.hpp"
#include "dynslam/runtime/nets/segmentation_stage.hpp"
#include "dynslam/runtime/run/run_watch.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/tracker.hpp"

namespace dynslam::runtime {

/// What `dynslam run` does.
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

/// Times of a stage per frame.
struct StageStatistics {
  double median_ms = 0, p95_ms = 0;
};

/// How far a run is.
struct Progress {
  std::size_t done = 0, total = 0;
  double fps = 0, seconds_left = 0;
  std::size_t lost = 0;
};

/// What a run did: summary.json.
struct RunSummary {
  std::size_t frames = 0;   ///< in the sequence (or up to the interruption)
  std::size_t tracked = 0;  ///< with a pose in trajectory.txt
  std::size_t lost = 0;     ///< read, but without a pose
  std::size_t broken = 0;   ///< could not be read
  std::size_t dropped = 0;  ///< came too fast; live alone
  double fps = 0, peak_rss_mb = 0;
  std::map<std::string, StageStatistics> stages;
  std::vector<StampedPose<double>> trajectory;
  std::vector<StampedPose<double>> live_trajectory;  ///< trajectory_live.txt, see Slam::live_trajectory()
  std::vector<LoopClosing> loops;
  std::vector<std::pair<std::string, MaskVerdict>> masks_rejected;  ///< time stamps of frames, and why
  std::vector<std::string> problems;                                ///< one line each, in order of frames
  std::string masks_from;  ///< what gave the a-priori masks and how it was read, in a line; empty: nothing
  std::size_t masked = 0;  ///< frames in which an a-priori mask marks something
  bool interrupted = false;
  std::optional<LiveStatistics> live;  ///< of a live run
  /// Of `lost`, frames that have a pose in a map of their own, whose place was never recognised:
  /// trajectory_map<number>.txt.
  std::vector<SeparateTrajectory> separate;
};

/// How a run reads its sequence.
[[nodiscard]] SequenceOptions sequence_options(const RunOptions& options);

/// Runs a sequence and writes config.toml (see options_file.hpp) at once, then trajectory.txt,
/// trajectory_live.txt (Slam::live_trajectory()), keyframes.txt, map.sot (and map_color.ot for octovis),
/// timings.csv, summary.json and masks/ into `options.out`, and trajectory_map2.txt, ... of maps that were
/// begun after a loss and never joined. What was computed is saved also when `stop` becomes true midway;
/// trajectories and summary.json are written as the run goes, see docs/reliability.md. A map that was loaded
/// is never saved poorer than it was: what a failed run has is added to it where that is whole, and else the
/// saved map stays.
/// @param opened  called with the sequence and its camera before the first frame
/// @param watch   called while the run goes on
/// @throws InputError  unreadable sequence or masks, unwritable output, too many broken frames, or no frame
///         tracked at all (the files are written first where possible)
/// @throws UsageError  options that contradict each other
RunSummary run_sequence(const RunOptions& options, const std::atomic<bool>& stop,
                        const std::function<void(const Progress&)>& progress = {},
                        const std::function<void(const Sequence&, const CameraConfig&)>& opened = {},
                        const RunWatch& watch = {});

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
