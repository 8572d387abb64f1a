// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "slam/tidy_map.hpp"

namespace dynslam::runtime {

/// The octree of a run: the scans of its keyframes, which follow where the map of keyframes has them.
///
/// Scans go in at once, with the pose known then, so that the map shows what is there now; a map that waited
/// for final poses would be late by as much as a robot drives in a loop.
class RunMap {
 public:
  /// @param callback  see SemanticMapper
  RunMap(const CameraConfig& camera, const SemanticMapperOptions& options,
         SemanticMapper::MapCallback callback = {});

  /// Starts from the scans of an earlier run's folder, where it has some. @throws InputError
  void load(const std::filesystem::path& folder, const ScanOwner& owner);
  /// Adds a keyframe. @param T_w_earlier  pose of the frame that `prior` has labels of; nullopt: unknown
  /// @throws what the mapper's thread met
  void insert(const TrackResult& result, const RgbdFrame& frame, const std::optional<Masks>& prior,
              const std::optional<SE3<double>>& T_w_earlier);
  /// Has the octree made again where a correction of the poses (a loop, bundle adjustment) is worth it.
  void follow(const LocalMap& map);
  /// Waits until everything is in the tree. @throws what the mapper's thread met
  void finish() { mapper_.finish(); }
  /// Writes map.sot, and map_color.ot for octovis, which knows no labels. Call finish() first.
  /// @throws InputError
  void save(const std::filesystem::path& out);

  /// Takes out of a copy of the map what neither tracking nor a scan needs, see tidy_map(). Call finish()
  /// first.
  [[nodiscard]] std::vector<int> tidy(LocalMap& map) const {
    return tidy_map(map, mapper_.saved_keyframes());
  }

  [[nodiscard]] const SemanticMapper& mapper() const { return mapper_; }

 private:
  double resolution_;
  SemanticMapper mapper_;
  cv::Mat margin_, never_map_;
  std::vector<std::pair<int, SE3<double>>> mapped_;  // keyframe, T_w_c that the octree has
};

}  // namespace dynslam::runtime
