// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/map_leftovers.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <tuple>

#include "dynslam/image/depth.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

constexpr int kPixelStep = 2;        // in both directions: a voxel of 5 cm at 3 m has ten pixels across
constexpr double kSameTime = 0.001;  // of a pose and its frame [s]

struct SeenVoxel {
  bool dynamic = false, resting = false;  // which of its pixels were seen
};
struct KeyOrder {
  bool operator()(const octomap::OcTreeKey& a, const octomap::OcTreeKey& b) const {
    return std::tie(a.k[0], a.k[1], a.k[2]) < std::tie(b.k[0], b.k[1], b.k[2]);
  }
};
using SeenVoxels = std::map<octomap::OcTreeKey, SeenVoxel, KeyOrder>;

/// Marks the occupied voxels that a frame sees.
void see(const RgbdFrame& frame, const cv::Mat& mask, const CameraConfig& camera, const SE3<double>& T_w_c,
         const interop::SemanticOcTree& tree, SeenVoxels& seen) {
  for (int v = 0; v < frame.depth.rows; v += kPixelStep) {
    for (int u = 0; u < frame.depth.cols; u += kPixelStep) {
      const auto z = static_cast<double>(frame.depth.at<float>(v, u));
      if (!is_valid_depth(z)) continue;
      const auto p_c = camera.model.unproject({u, v}, z);
      if (!p_c) continue;
      const Eigen::Vector3d p = T_w_c * *p_c;
      octomap::OcTreeKey key;
      if (!tree.coordToKeyChecked(p.x(), p.y(), p.z(), key)) continue;
      const auto* node = tree.search(key);
      if (node == nullptr || !tree.isNodeOccupied(node)) continue;
      SeenVoxel& voxel = seen[key];
      (mask.at<std::uint8_t>(v, u) != 0 ? voxel.dynamic : voxel.resting) = true;
    }
  }
}

}  // namespace

MapLeftovers map_leftovers(const fs::path& run, const fs::path& sequence_path,
                           const SequenceOptions& options) {
  const Sequence sequence = load_sequence(sequence_path, options);
  const fs::path masks = sequence.root / "dynamic_mask";
  if (!fs::is_directory(masks))
    throw InputError(masks.string(), 0, "is missing: what moves in the sequence is not known");
  const CameraConfig camera = camera_of(sequence);
  const auto tree = load_map(map_file_in(run));
  const auto trajectory = read_trajectory(run / "trajectory.txt");

  MapLeftovers result;
  result.edge = tree->getResolution();
  SeenVoxels seen;
  auto pose = trajectory.begin();
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const FrameRecord& record = sequence.frames[i];
    while (pose != trajectory.end() && pose->t < record.t_rgb - kSameTime) ++pose;
    if (pose == trajectory.end()) break;
    const fs::path file = masks / (record.stamp + ".png");
    if (std::abs(pose->t - record.t_rgb) > kSameTime || !fs::exists(file)) continue;
    const RgbdFrame frame = decode_frame(record, i, camera);
    const cv::Mat mask = read_image(file, cv::IMREAD_GRAYSCALE);
    if (mask.size() != frame.depth.size())
      throw InputError(file.string(), 0, "has another size than the depth image");
    see(frame, mask, camera, pose->T_w_c, *tree, seen);
    ++result.frames;
  }
  if (result.frames == 0)
    throw InputError(
        masks.string(), 0,
        fmt::format("has no mask of a frame with a pose in {}: {}.png and the like are looked for",
                    (run / "trajectory.txt").string(), sequence.frames.front().stamp));
  for (const auto& [key, voxel] : seen) result.voxels += voxel.dynamic && !voxel.resting ? 1U : 0U;
  return result;
}

nlohmann::json to_json(const MapLeftovers& leftovers) {
  return {{"frames", leftovers.frames}, {"voxels", leftovers.voxels}, {"edge_m", leftovers.edge}};
}

std::string to_text(const MapLeftovers& leftovers) {
  return fmt::format("map: {} voxels of {:.0f} cm hold dynamic objects (true masks of {} frames)\n",
                     leftovers.voxels, 100 * leftovers.edge, leftovers.frames);
}

}  // namespace dynslam::runtime
