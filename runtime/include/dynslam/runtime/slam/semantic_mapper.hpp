// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/map_classes.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/slam/map_scan.hpp"
#include "dynslam/runtime/threads/bounded_queue.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/scan_retention.hpp"

namespace dynslam::runtime {

/// The saved keyframes that saved scans belong to.
struct ScanOwner {
  std::uint64_t map_id = 0;  ///< of saved_map.hpp: tells one saved state of a map from every other one
  int keyframes = 0;         ///< a scan's keyframe is one of these
};

/// Options of SemanticMapper.
struct SemanticMapperOptions {
  double resolution = 0.05;  ///< metres
  MapScanOptions scan;
  LogOddsParams<float> occupancy;
  std::size_t queue = 2;  ///< keyframes waiting with their images; beyond, insert() blocks
  /// About what the octree may take [bytes]; beyond, insert() and finish() throw. A room of 100 m^2 takes 20
  /// MB at 5 cm, so that more is mostly a mistake in the resolution or the camera.
  std::size_t max_bytes = std::size_t(2) << 30;
  bool retain_scans = true;  ///< keep what repose() needs, about 400 kB per keyframe
  /// Of those that are kept, how many show the same view at most, see retire_scans(); 0: all are kept.
  int scans_per_view = 0;
  MapClasses classes;  ///< names of the labels, saved with the tree

  /// Those of a run: the first scan of a view, and as many as take a voxel to its bounds but one.
  [[nodiscard]] static SemanticMapperOptions of_run() {
    SemanticMapperOptions options;
    options.scans_per_view = 4;
    return options;
  }
};

/// Labels of another frame that a keyframe takes over where it shows the same surface.
struct LabelledView {
  cv::Mat depth;   ///< CV_32FC1 metres, NaN = invalid
  cv::Mat labels;  ///< CV_8UC1 of Label; people are not taken over
  SE3<double> T_w_c;
};

/// A keyframe's contribution to the map.
struct MapKeyframe {
  SE3<double> T_w_c;
  cv::Mat depth;                             ///< CV_32FC1 metres, NaN = invalid
  cv::Mat dynamic_mask;                      ///< CV_8UC1, nonzero is never mapped; empty: nothing masked
  cv::Mat labels;                            ///< CV_8UC1 of Label, or empty
  cv::Mat bgr;                               ///< CV_8UC3
  int id = -1;                               ///< names the keyframe in repose()
  std::optional<LabelledView> earlier = {};  ///< gives labels to pixels that have none of their own
};

/// Fuses keyframes into a semantic octree on a thread of its own (paper, Eqs 9 to 12).
///
/// Per keyframe each voxel is updated once, occupied before free; people (Label::person) and masked pixels
/// are never occupied, but the way to them is free. The result depends on the keyframes, the poses and their
/// order alone.
///
/// What is queued comes before what is to be fused again: while the tree is rebuilt after a correction, new
/// keyframes are reduced to their scans, which wait at the end of the row, and a further correction starts
/// the rebuilding over. So the caller waits for the fusion of one scan at most, not for that of a map.
class SemanticMapper {
 public:
  /// Called with the tree on the mapper's thread, whose time it takes, and which goes on when it returns.
  using MapCallback = std::function<void(const interop::SemanticOcTree&)>;

  /// @param callback  called when a scan has been fused, but for those of a tree that is rebuilt, until it
  /// has all
  ///              that it had before; what it throws ends the mapping
  SemanticMapper(const AnyCamera<double>& camera, int width, int height, const SemanticMapperOptions& options,
                 MapCallback callback = {});

  /// Queues a keyframe; the images are shared, not copied, and must not be changed afterwards.
  /// Blocks while the queue is full; without retained scans until earlier ones are fused.
  /// @throws UsageError for images of another size or type, or a pose that is none; what the thread met
  void insert(MapKeyframe keyframe);
  /// Queues a correction of keyframes' poses, as after a closed loop: the tree is built again from the scans
  /// queued so far, in their order, with these poses; keyframes that are not named keep theirs, unknown names
  /// are ignored. The tree is then what it would be had the keyframes come with these poses (the last one
  /// given to each). Blocks while the queue is full. @throws UsageError without retained scans; what the
  /// thread met
  void repose(std::vector<std::pair<int, SE3<double>>> T_w_c);
  /// Queues the scans of an earlier session (save_scans). @return their keyframes and poses
  /// @throws InputError naming the file: missing, truncated, corrupt, of another camera or of other keyframes
  std::vector<std::pair<int, SE3<double>>> load_scans(const std::filesystem::path& path,
                                                      const ScanOwner& owner);
  /// Waits until everything is in the tree. @throws what the thread met
  void finish();
  /// Writes the tree (`.sot`, as save_map() does) through a temporary file. Call finish() first. @throws
  /// InputError
  void save(const std::filesystem::path& path) const;
  /// Writes the retained scans. What two later sessions have scanned again from about the same place
  /// (same_view()) is left out, so that the file does not grow with the number of visits.
  /// Call finish() first. @param map_id  of the keyframes saved with them
  /// @param names  by which each keyframe is saved; empty: as they are
  /// @throws InputError
  void save_scans(const std::filesystem::path& path, std::uint64_t map_id,
                  const std::vector<int>& names = {}) const;
  /// Keyframes of the scans that save_scans() writes. Valid after finish().
  [[nodiscard]] std::vector<int> saved_keyframes() const;
  /// Names of the labels.
  [[nodiscard]] const MapClasses& classes() const { return options_.classes; }
  /// Takes over the names of a map whose scans are loaded.
  /// @throws UsageError where one of its labels has another name here
  void add_classes(const MapClasses& classes);
  /// Valid after finish().
  [[nodiscard]] const interop::SemanticOcTree& tree() const { return tree_; }
  /// Memory of the retained scans. Valid after finish().
  [[nodiscard]] std::size_t retained_bytes() const;

 private:
  using Poses = std::vector<std::pair<int, SE3<double>>>;
  struct Retained {
    int id;
    SE3<double> T_w_c;
    MapScan scan;
    int session = 0;  // that made it, counted from the first
    ScanRank rank = {};
  };
  using Scans = std::vector<Retained>;
  using Job = std::variant<MapKeyframe, Poses, Scans>;

  void work(const std::stop_token& stop);
  /// Whether scans are still to be fused. Of the thread alone.
  [[nodiscard]] bool behind() const { return fused_ < scans_.size(); }
  void fuse_next();
  void check_size() const;
  /// Whether each scan is worth keeping.
  [[nodiscard]] std::vector<bool> still_needed() const;
  void run(MapKeyframe& keyframe);
  /// Gives the pixels of a keyframe the labels that an earlier frame has of the same surfaces.
  void take_labels(MapKeyframe& keyframe) const;
  void run(Poses& poses);
  void run(Scans& scans);

  SemanticMapperOptions options_;
  AnyCamera<float> camera_;
  cv::Size size_;  // of the images
  MapScanner scanner_;
  interop::SemanticOcTree tree_;
  ScanVoxels voxels_;
  Scans scans_;            // in their order; those that are fused are kept where they are retained
  std::size_t fused_ = 0;  // of them, in the tree
  int session_ = 0;        // of new scans
  MapCallback callback_;
  std::size_t announced_scans_ = 0;  // in the tree at the last call of callback_

  BoundedQueue<Job> queue_;
  std::jthread thread_;  // last: it uses all of the above
};

/// Copies saved scans for other saved keyframes: the same ones with corrected poses, or with more behind
/// them.
/// @throws InputError like load_scans() and save_scans()
void copy_scans(const std::filesystem::path& from, std::uint64_t from_id, const std::filesystem::path& to,
                std::uint64_t to_id);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
