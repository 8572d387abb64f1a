// SPDX-License-Identifier: BSD-3-Clause
#include <array>

#include "config/field_list.hpp"

namespace dynslam::runtime::config {

std::span<const std::string_view> user_field_names() {
  using namespace std::string_view_literals;
  static constexpr std::array kNames{
      "general.dynamics"sv,
      "general.seed"sv,
      "general.camera"sv,
      "general.readout_time"sv,
      "general.format"sv,
      "general.topics"sv,
      "general.rate"sv,
      "general.masks"sv,
      "general.mask_labels"sv,
      "general.save_masks"sv,
      "general.report"sv,
      "general.map"sv,
      "general.map_resolution"sv,
      "general.map_memory"sv,
      "general.load_map"sv,
      "general.max_frames"sv,
      "general.save_every"sv,
      "general.max_broken"sv,
      "general.schedule"sv,
      "general.live_speed"sv,
      "general.live_gap"sv,
      "live.queue"sv,
      "live.mask_age"sv,
      "new_map.begin"sv,
      "new_map.after"sv,
      "trajectory.smooth"sv,
      "segmentation.every"sv,
      "segmentation.period"sv,
      "segmentation.keep"sv,
      "segmentation.cache"sv,
      "segmentation.async"sv,
      "segmentation.segmenter.model"sv,
      "segmentation.segmenter.engine"sv,
      "segmentation.segmenter.kind"sv,
      "segmentation.segmenter.output"sv,
      "segmentation.segmenter.output_name"sv,
      "segmentation.segmenter.threads"sv,
      "segmentation.segmenter.dynamic_classes"sv,
      "segmentation.segmenter.map_classes"sv,
      "segmentation.segmenter.input"sv,
      "segmentation.segmenter.detection.min_score"sv,
      "tracker.method"sv,
      "tracker.additions"sv,
      "tracker.semantic_dilation"sv,
      "tracker.bundle"sv,
      "tracker.close_loops"sv,
      "tracker.features.features"sv,
      "tracker.depth_noise.base"sv,
      "tracker.depth_noise.quad"sv,
      "tracker.depth_noise.linear"sv,
      "tracker.search.max_speed"sv,
      "tracker.search.max_turn"sv,
      "tracker.geometry.weights.nu"sv,
      "tracker.geometry.weights.tau"sv,
      "tracker.pose.nu"sv,
      "tracker.points.max_depth"sv,
      "mapper.scan.pixel_stride"sv,
      "mapper.scan.max_range"sv,
  };
  return kNames;
}

}  // namespace dynslam::runtime::config
