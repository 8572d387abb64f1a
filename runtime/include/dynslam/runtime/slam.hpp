// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/nets/frame_segmenter.hpp"
#include "dynslam/runtime/slam/new_map_options.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/slam_events.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "dynslam/runtime/slam/trajectory_options.hpp"

namespace dynslam::runtime {

/// Options of Slam; the defaults need no network.
struct SlamOptions {
  DynamicsMode dynamics = DynamicsMode::geometric;
  /// A network whose masks are taken where none are given, on the calling thread; needs `semantic` or `both`.
  std::optional<FrameSegmenterOptions> network;
  bool map = true;               ///< build the octree
  double map_resolution = 0.05;  ///< edge of a voxel [m]
  std::size_t map_memory = std::size_t(2)
                           << 30;  ///< bytes that the octree may take; a keyframe too many throws
  std::uint64_t seed = 1;          ///< of every random choice
  TrackerOptions tracker;          ///< its `dynamics` and seeds are set from those above
  /// How the octree is made; its `resolution` and `max_bytes` are set from those above.
  SemanticMapperOptions mapper = SemanticMapperOptions::of_run();
  NewMapOptions new_map;         ///< what a loss that lasts begins
  TrajectoryOptions trajectory;  ///< how trajectory() is smoothed
  SlamEvents events{};           ///< functions to be called: keyframes, loops, adjustments, lost, found
  /// Called with the octree as it grows, on the octree's own thread, which waits for it: the only way to look
  /// at it before finish(). See SemanticMapper.
  SemanticMapper::MapCallback mapped{};
};

/// Poses in a map that was begun while the camera was lost and has not been joined to the main one.
struct SeparateTrajectory {
  int map = 0;                             ///< its number, from 2
  std::vector<StampedPose<double>> poses;  ///< T_w_c in a world of its own, of frames that trajectory() lacks
};

/// RGB-D SLAM from frames in memory:
///
///     Slam slam(load_camera("fr3"));
///     const TrackResult result = slam.track(bgr, depth, t);
///     if (result.ok()) publish(result.T_w_c, result.dynamic_mask);
///     ...
///     slam.finish();
///     slam.trajectory();   // of all frames, after loops and adjustments; live_trajectory(): as they came
///
/// Same frames, same results, to the last bit: those of `dynslam run`, which uses it. Objects do not know of
/// each other; one object is used by one thread at a time. It has threads of its own for adjustment and map.
class Slam {
 public:
  /// @throws UsageError for options that contradict each other; what the network's file makes it throw
  explicit Slam(const CameraConfig& camera, const SlamOptions& options = {});
  ~Slam();
  Slam(const Slam&) = delete;
  Slam& operator=(const Slam&) = delete;

  /// Tracks the next frame. The images may be of any row stride and are the caller's again afterwards.
  /// @param image  CV_8UC3 (BGR), CV_8UC4 (BGRA) or CV_8UC1 (grey), of the camera's size
  /// @param depth  registered to the image: CV_16UC1 in the camera's units, 0 = none, or CV_32FC1 in metres,
  ///               NaN or <= 0 = none
  /// @param t      time of the image [s], later than the one before
  /// @param prior  a-priori masks; nullopt: the network's, where there is one
  /// @param depth_delay  time of the depth image less that of the image [s]
  /// @throws InputError with what it got and what was expected, with nothing changed
  TrackResult track(const cv::Mat& image, const cv::Mat& depth, double t,
                    const std::optional<Masks>& prior = std::nullopt, double depth_delay = 0);
  /// The same with a time that keeps its nanoseconds; trajectory() has them beside the seconds.
  TrackResult track(const cv::Mat& image, const cv::Mat& depth, std::chrono::nanoseconds t,
                    const std::optional<Masks>& prior = std::nullopt, double depth_delay = 0);
  /// The same for a frame that was prepared elsewhere. Its images are kept and must not change afterwards.
  TrackResult track(const RgbdFrame& frame, const std::optional<Masks>& prior = std::nullopt);

  /// Waits for what is computed beside the frames, and uses it. Call it before results are read; more frames
  /// may follow. @throws what went wrong there
  void finish();

  /// Poses T_w_c of all frames that were tracked, each beside its keyframe as the map has that by now. After
  /// finish(), until the next frame, they are smoothed (SlamOptions::trajectory): a pose of a frame in the
  /// middle is better for those that came after it.
  [[nodiscard]] std::vector<StampedPose<double>> trajectory() const;
  /// What track() returned: T_w_c of each frame that it had a pose of at once, as the map was then, by which
  /// a robot acts while it drives. Nothing that came later enters: no smoothing, adjustment or loop. A frame
  /// that was lost at once has none, nor has one that only a map begun since had (TrackResult::separate),
  /// whose place in the main one nobody knew yet, so that all are in one world: that of the first frame, or
  /// of the map that was loaded.
  [[nodiscard]] const std::vector<StampedPose<double>>& live_trajectory() const;
  /// Those of the frames that became keyframes, where the map has them.
  [[nodiscard]] std::vector<StampedPose<double>> keyframe_trajectory() const;
  /// What was tracked while the camera was lost in the main map, and was never joined to it.
  [[nodiscard]] std::vector<SeparateTrajectory> separate_trajectories() const;
  /// Keyframes and points.
  [[nodiscard]] const LocalMap& map() const;
  /// The semantic octree; null without `SlamOptions::map`. Valid after finish(), until the next frame.
  [[nodiscard]] const interop::SemanticOcTree* octree() const;

  /// Has the frames that follow tell how long the camera reads its rows. Poses stay what they are; a camera
  /// with a `readout_time` is then tracked without the search for turns within a frame, which would explain
  /// the same. Call it before the first frame.
  void measure_readout();
  /// What they measured, see ReadoutMeasurement; empty without measure_readout().
  [[nodiscard]] const std::optional<ReadoutMeasurement<double>>& readout() const;

  /// What the geometry found in the frame that track() had last: its mask, and keypoints with their static
  /// weights. Null where the mode does not ask it, or the frame has no pose in the main map. Valid until the
  /// next frame.
  [[nodiscard]] const MotionResult<double>* motion() const;

  /// Saves the map for load(); see save_slam_map(). A saved map is never made poorer: without an octree, the
  /// scans and the octree of the map that was loaded are taken over. Maps that were never joined to the main
  /// one are saved in it as map2, map3 or the next name that is free, each for load().
  /// @throws InputError: the folder cannot be written, or it holds a map and whole() does not hold
  void save(const std::filesystem::path& folder);
  /// Goes on in a map that was saved: the camera is lost until it finds itself there. Call it before the
  /// first frame. @throws InputError naming the file
  void load(const std::filesystem::path& folder);
  /// Writes the octree as map.sot, and as map_color.ot for octovis. @throws InputError
  void save_octree(const std::filesystem::path& folder);
  /// Forgets all frames and maps.
  void reset();

  /// False after a call that threw midway (memory, the octree's limit): the map may be in pieces.
  [[nodiscard]] bool whole() const;

 private:
  struct State;
  /// Of a frame that nobody has prepared: asks the network where there is one.
  TrackResult track_new(const RgbdFrame& frame, const std::optional<Masks>& prior);
  std::unique_ptr<State> state_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
