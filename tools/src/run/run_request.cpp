// SPDX-License-Identifier: BSD-3-Clause
#include "run/run_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {

bool uses_network(const RunOptions& options) {
  return uses_semantic(options.dynamics) && !options.segmentation.segmenter.model.empty();
}

void check_request(const RunOptions& options) {
  if (uses_semantic(options.dynamics) && options.masks.empty() && !uses_network(options)) {
    throw UsageError(
        fmt::format("--dynamics {} needs a-priori masks: give --model FILE.onnx or --masks DIR, or use "
                    "--dynamics geometric",
                    to_string(options.dynamics)));
  }
  if (uses_network(options) && !options.masks.empty())
    throw UsageError("--model and --masks exclude each other");
  if (options.schedule == Schedule::live && uses_network(options) && !options.segmentation.keep)
    throw UsageError("--live carries the network's masks to later frames, which --keep-masks false forbids");
  std::error_code error;
  if (options.save_masks && std::filesystem::equivalent(options.out / "masks", options.masks, error))
    throw UsageError(fmt::format("--save-masks would replace the masks of --masks {}: name another --out",
                                 options.masks.string()));
  if (!options.save_map.empty() && lies_in(options.out, options.save_map))
    throw UsageError(fmt::format("--out {} lies in the folder of --save-map, which is replaced as a whole",
                                 options.out.string()));
  if (!options.save_map.empty() && !options.load_map.empty() && !options.map) {  // it is copied in the end
    if (const auto octree = map_file_in(options.load_map); std::filesystem::exists(octree))
      (void)load_map(octree);
  }
}

namespace {

MapClasses loaded_classes(const RunOptions& options) {
  return options.load_map.empty() ? MapClasses() : load_map_classes(map_file_in(options.load_map));
}

}  // namespace

MaskOptions mask_options(const RunOptions& options) {
  const SegmenterOptions& s = options.segmentation.segmenter;
  return {options.mask_labels, s.dynamic_classes, s.map_classes, loaded_classes(options)};
}

MapClasses map_classes(const RunOptions& options) {
  if (!uses_semantic(options.dynamics)) return loaded_classes(options);
  if (!uses_network(options)) return labels_of_masks(mask_options(options));
  return with_classes(loaded_classes(options), options.segmentation.segmenter.map_classes);
}

void check_masks_are_there(const RunOptions& options, const Sequence& sequence) {
  std::error_code error;
  for (const FrameRecord& frame : sequence.frames) {
    if (std::filesystem::exists(options.masks / (frame.stamp + ".png"), error)) return;
  }
  if (!std::filesystem::is_directory(options.masks, error)) return;  // which who reads them says
  std::vector<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(options.masks, error))
    names.push_back(file.path().filename().string());
  std::sort(names.begin(), names.end());
  throw InputError(
      options.masks.string(), 0,
      fmt::format("has no mask for any frame of the sequence: {}.png and the like are looked for, it "
                  "holds {}",
                  sequence.frames.front().stamp,
                  names.empty() ? "nothing" : names.front() + (names.size() > 1 ? " and the like" : "")));
}

namespace {

/// Whether a run writes or removes a file of this name in its folder.
bool is_result(const std::string& name) {
  constexpr std::array<std::string_view, 11> kResults{
      "config.toml",   "summary.json", "trajectory.txt", "trajectory_live.txt",
      "keyframes.txt", "timings.csv",  "map_color.ot",   "report.html",
      "report.jsonl",  kMapFile,       kEarlierMapFile};
  return name.starts_with("trajectory_map") ||
         std::find(kResults.begin(), kResults.end(), name) != kResults.end();
}

}  // namespace

void check_inputs_stay(const RunOptions& options, const Sequence& sequence) {
  namespace fs = std::filesystem;
  if (options.save_masks) check_no_input(sequence, options.out / "masks");
  std::error_code error;
  if (options.map && fs::equivalent(options.out, options.load_map, error))
    throw UsageError(
        fmt::format("--out {} is the folder of --load-map, whose map would be replaced: name another --out",
                    options.out.string()));
  const std::array<fs::path, 6> inputs{
      options.sequence,
      sequence.truth_file,
      sequence.camera_hint,
      options.camera,
      options.segmentation.segmenter.model,
      options.map && !options.load_map.empty() ? map_file_in(options.load_map) : fs::path()};
  for (const auto& entry : fs::directory_iterator(options.out, error)) {
    if (!is_result(entry.path().filename().string())) continue;
    for (const fs::path& input : inputs) {
      if (fs::equivalent(entry.path(), input, error))  // also by a link, from either side
        throw UsageError(
            fmt::format("{} is read by this run, which would replace it by {}: name another --out",
                        input.string(), entry.path().string()));
    }
  }
}

SequenceOptions sequence_options(const RunOptions& options) {
  SequenceOptions result;
  result.max_frames = options.max_frames;
  result.format = options.format;
  result.topics = options.topics;
  result.rate = options.rate;
  result.camera = options.camera;
  return result;
}

SlamOptions slam_options(const RunOptions& options) {
  SlamOptions result;
  // Else without a network: its masks are made ahead, on a thread of their own.
  if (options.schedule == Schedule::live && uses_network(options)) result.network = options.segmentation;
  result.dynamics = options.dynamics;
  result.map = options.map;
  result.map_resolution = options.map_resolution;
  result.map_memory = options.map_memory;
  result.seed = options.seed;
  result.tracker = options.tracker;
  result.mapper = options.mapper;
  result.mapper.classes = map_classes(options);
  if (result.network) result.network->segmenter.labels = loaded_classes(options);
  result.new_map = options.new_map;
  result.trajectory = options.trajectory;
  return result;
}

}  // namespace dynslam::runtime
