// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "dynslam/runtime/slam/new_map_options.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "slam/frame_poses.hpp"

namespace dynslam::runtime {

/// A map that was begun while the camera was lost, in a world of its own: its first frame's.
class SeparateMap {
 public:
  SeparateMap(const CameraConfig& camera, const TrackerOptions& options) : tracker_(camera, options) {}

  /// Tracks a frame. @param lost_elsewhere  the main map has no pose of it; then this one's counts
  TrackResult track(const RgbdFrame& frame, const std::optional<Masks>& prior, bool lost_elsewhere);
  /// Notes where both maps have the camera. @return whether that has agreed for long enough
  bool agrees(const SE3<double>& T_main_c, const SE3<double>& T_w_c, const NewMapOptions& options);
  void disagrees() { agreeing_ = 0; }

  /// Where this map's world lies in the main one, as last noted.
  [[nodiscard]] const SE3<double>& T_main_w() const { return T_main_w_; }
  [[nodiscard]] Tracker& tracker() { return tracker_; }
  [[nodiscard]] const Tracker& tracker() const { return tracker_; }
  [[nodiscard]] const FramePoses& frames() const { return frames_; }

  struct Scan {  // of a keyframe, for the octree
    TrackResult result;
    RgbdFrame frame;
    std::optional<Masks> prior;
  };
  void keep(Scan scan, std::size_t most);
  [[nodiscard]] const std::vector<Scan>& scans() const { return scans_; }

  int number = 0;                      ///< from 2, as soon as it has a frame
  bool watched = true;                 ///< gets every frame, not keyframes of the main map alone
  int beside = 0;                      ///< frames tracked beside the main map without being joined
  std::optional<double> lost_since{};  ///< [s]

 private:
  Tracker tracker_;
  FramePoses frames_;
  std::vector<Scan> scans_;
  SE3<double> T_main_w_;
  int agreeing_ = 0;
};

/// The maps beside the main one, which are begun when it has been lost for long.
class SeparateMaps {
 public:
  SeparateMaps(const CameraConfig& camera, const TrackerOptions& options, const NewMapOptions& new_map,
               bool scans)
      : camera_(camera), tracking_(options), options_(new_map), scans_(scans) {}

  /// The frame that the main map's tracker has just seen. Where it is lost, `result` gets the pose in the map
  /// that is tracked instead.
  /// @return a map that is to be joined now; it is this object's no more
  [[nodiscard]] std::unique_ptr<SeparateMap> see(const RgbdFrame& frame, const std::optional<Masks>& prior,
                                                 TrackResult& result);

  [[nodiscard]] const std::vector<std::unique_ptr<SeparateMap>>& maps() const { return maps_; }
  /// Maps begun so far.
  [[nodiscard]] int begun() const { return begun_; }
  /// Uses what is still being adjusted.
  void finish();

 private:
  void see_lost(const RgbdFrame& frame, const std::optional<Masks>& prior, TrackResult& result);
  std::unique_ptr<SeparateMap> see_found(const RgbdFrame& frame, const std::optional<Masks>& prior,
                                         const TrackResult& result);

  CameraConfig camera_;
  TrackerOptions tracking_;
  NewMapOptions options_;
  bool scans_;
  std::vector<std::unique_ptr<SeparateMap>> maps_;  // oldest first
  std::optional<double> lost_since_;                // of the main map [s]
  int begun_ = 0;
};

}  // namespace dynslam::runtime
