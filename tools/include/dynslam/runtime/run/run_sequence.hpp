// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <atomic>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/config/run_options.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/live.hpp"
#include "dynslam/runtime/run/run_watch.hpp"
#include "dynslam/runtime/slam/tracker.hpp"

namespace dynslam::runtime {

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
  std::vector<std::string> warnings;  ///< of the input as a whole, a line each, with what mends it
  std::string masks_from;  ///< what gave the a-priori masks and how it was read, in a line; empty: nothing
  std::size_t masked = 0;  ///< frames in which an a-priori mask marks something
  bool nothing_mapped = false;  ///< an octree was built, and no voxel of it is occupied
  bool interrupted = false;
  std::optional<LiveStatistics> live;  ///< of a live run
  /// Of `lost`, frames that have a pose in a map of their own, whose place was never recognised:
  /// trajectory_map<number>.txt.
  std::vector<SeparateTrajectory> separate;
};

/// How a run reads its sequence.
[[nodiscard]] SequenceOptions sequence_options(const RunOptions& options);

/// @throws UsageError  options that contradict each other; InputError  an octree that would be copied is
/// damaged
void check_request(const RunOptions& options);

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
