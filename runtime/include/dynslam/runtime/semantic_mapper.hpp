// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <octomap/ColorOcTree.h>

#include <array>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <filesystem>
#include <mutex>
#include <opencv2/core.hpp>
#include <thread>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/mask_reader.hpp"
#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/log_odds.hpp"

namespace dynslam::runtime {

/// Colour of a class in the map (R, G, B): a voxel of class chair or display has exactly this colour,
/// background voxels carry the observed colour. That is how labels are read back from a `.ot` file.
[[nodiscard]] octomap::ColorOcTreeNode::Color class_colour(Label label);
/// Label of a voxel of a saved map, by its colour.
[[nodiscard]] Label label_of_colour(const octomap::ColorOcTreeNode::Color& colour);

struct SemanticMapperOptions {
  double resolution = 0.05;  ///< metres
  double max_range = 4.0;    ///< metres along the optical axis; farther depth is too coarse to map
  int pixel_stride = 2;      ///< every so many pixels in both directions
  LogOddsParams<float> occupancy;
  std::size_t queue = 2;     ///< keyframes waiting; beyond, insert() blocks
};

/// A keyframe's contribution to the map.
struct MapKeyframe {
  SE3<double> T_w_c;
  cv::Mat depth;         ///< CV_32FC1 metres, NaN = invalid
  cv::Mat dynamic_mask;  ///< CV_8UC1, nonzero is never mapped; empty: nothing masked
  cv::Mat labels;        ///< CV_8UC1 of Label, or empty
  cv::Mat bgr;           ///< CV_8UC3
};

/// Fuses keyframes into an octree on a thread of its own (paper, step 11; Eqs 9 to 12).
///
/// Per keyframe each voxel is updated once, occupied before free; people (Label::person) and masked
/// pixels are never mapped. The result depends on the keyframes and their order alone.
class SemanticMapper {
 public:
  SemanticMapper(const DistortedPinhole<double>& camera, int width, int height, const SemanticMapperOptions& options);

  /// Queues a keyframe; the images are shared, not copied, and must not be changed afterwards.
  /// Blocks while the queue is full. @throws what the thread met
  void insert(MapKeyframe keyframe);
  /// Waits until everything is in the tree. @throws what the thread met
  void finish();
  /// Writes the tree (OctoMap `.ot`) through a temporary file. Call finish() first. @throws InputError
  void save(const std::filesystem::path& path) const;
  /// Valid after finish().
  [[nodiscard]] const octomap::ColorOcTree& tree() const { return tree_; }

 private:
  using Key = octomap::OcTreeKey;
  using KeyHash = octomap::OcTreeKey::KeyHash;
  struct Voxel {  // what the tree's node cannot hold
    LabelHistogram<4> labels;
    std::array<float, 3> colour{};  // running mean
    int samples = 0;
  };

  void work(const std::stop_token& stop);
  void fuse(const MapKeyframe& keyframe);

  SemanticMapperOptions options_;
  int width_;  // of the images [px]
  std::vector<Eigen::Vector3f> rays_;  // per used pixel, z = 1
  std::vector<int> pixels_;            // its index in the image
  octomap::ColorOcTree tree_;
  std::unordered_map<Key, Voxel, KeyHash> voxels_;
  std::vector<Key> hits_, misses_;
  std::unordered_set<Key, KeyHash> hit_set_, miss_set_;
  octomap::KeyRay ray_;

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<MapKeyframe> queue_;
  bool busy_ = false;
  std::exception_ptr failure_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace dynslam::runtime
