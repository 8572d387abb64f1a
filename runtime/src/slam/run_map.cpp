// SPDX-License-Identifier: BSD-3-Clause
#include "slam/run_map.hpp"

#include <opencv2/imgproc.hpp>
#include <system_error>
#include <utility>

#include "dynslam/runtime/io/map_io.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kMaskMargin = 7;     // pixels around moving objects that never become map
constexpr double kRange = 3.0;     // metres at which a turn of a keyframe is judged
constexpr double kWorthIt = 0.25;  // of a voxel: a surface's shift for which the octree is made again

}  // namespace

RunMap::RunMap(const CameraConfig& camera, const SemanticMapperOptions& options,
               SemanticMapper::MapCallback callback)
    : resolution_(options.resolution),
      mapper_(camera.model, camera.width, camera.height, options, std::move(callback)),
      margin_(cv::getStructuringElement(cv::MORPH_RECT, {2 * kMaskMargin + 1, 2 * kMaskMargin + 1})) {}

void RunMap::load(const std::filesystem::path& folder, const ScanOwner& owner) {
  mapper_.add_classes(load_map_classes(map_file_in(folder)));
  if (std::filesystem::exists(folder / "scans.bin"))
    mapped_ = mapper_.load_scans(folder / "scans.bin", owner);
}

void RunMap::insert(const TrackResult& result, const RgbdFrame& frame, const std::optional<Masks>& prior,
                    const std::optional<SE3<double>>& T_w_earlier) {
  // Who rests serves the pose; the map never gets what may move.
  const bool known = prior && !prior->dynamic.empty();
  cv::dilate(known ? result.dynamic_mask | prior->dynamic : cv::MatExpr(result.dynamic_mask), never_map_,
             margin_);
  MapKeyframe keyframe{result.T_w_c, frame.depth,     never_map_.clone(), prior ? prior->labels : cv::Mat(),
                       frame.bgr,    result.reference};
  if (prior && prior->earlier && T_w_earlier)
    keyframe.earlier = LabelledView{prior->earlier->depth, prior->earlier->labels, *T_w_earlier};
  mapper_.insert(std::move(keyframe));
  mapped_.emplace_back(result.reference, result.T_w_c);
}

void RunMap::follow(const LocalMap& map) {
  bool moved = false;
  for (const auto& [keyframe, T_w_c] : mapped_) {
    const SE3<double> now = map.pose(keyframe).inverse();
    const double turn = (now.so3() * T_w_c.so3().inverse()).log().norm();
    moved =
        moved || (now.translation() - T_w_c.translation()).norm() + kRange * turn > kWorthIt * resolution_;
  }
  if (!moved) return;
  for (auto& [keyframe, T_w_c] : mapped_) T_w_c = map.pose(keyframe).inverse();
  mapper_.repose(mapped_);
}

void RunMap::save(const std::filesystem::path& out) {
  mapper_.save(out / kMapFile);
  std::error_code ignored;  // the map of an earlier run by dynslam 0.1.0: this one takes its place
  if (is_semantic_map(out / kEarlierMapFile)) std::filesystem::remove(out / kEarlierMapFile, ignored);
  export_map(mapper_.tree(), out / "map_color.ot", mapper_.classes());
}

}  // namespace dynslam::runtime
