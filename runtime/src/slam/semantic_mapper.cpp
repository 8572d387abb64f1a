// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/semantic_mapper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <iterator>
#include <optional>
#include <unordered_map>
#include <utility>

#include "dynslam/interop/octomap.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/semantic/carried_labels.hpp"
#include "io/argument_check.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {
namespace {

static_assert(static_cast<int>(Label::person) == MapScanOptions{}.mover_label);

const SemanticMapperOptions& checked(const SemanticMapperOptions& options, int width, int height) {
  check_argument(width > 0 && height > 0, "SemanticMapper: the images' width and height must be above 0");
  check_argument(options.resolution >= 1e-4 && options.resolution <= 100,
                 "SemanticMapper: the resolution must be from 0.0001 to 100 m");
  return options;
}

}  // namespace

SemanticMapper::SemanticMapper(const AnyCamera<double>& camera, int width, int height,
                               const SemanticMapperOptions& options, MapCallback callback)
    : options_(checked(options, width, height)),
      camera_(camera.cast<float>()),
      size_(width, height),
      scanner_(camera, width, height, options.scan),
      tree_(options.resolution),
      voxels_(tree_.grid()),
      callback_(std::move(callback)),
      queue_(options.queue) {
  interop::set_parameters(tree_, options_.occupancy);
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void SemanticMapper::insert(MapKeyframe keyframe) {
  check_pose(keyframe.T_w_c, "SemanticMapper::insert(): the pose");
  check_image(keyframe.depth, size_, CV_32FC1, "SemanticMapper::insert(): the depth image");
  check_image(keyframe.bgr, size_, CV_8UC3, "SemanticMapper::insert(): the colour image");
  check_optional_image(keyframe.dynamic_mask, size_, CV_8UC1, "SemanticMapper::insert(): the mask");
  check_optional_image(keyframe.labels, size_, CV_8UC1, "SemanticMapper::insert(): the label image");
  if (keyframe.earlier) {
    check_pose(keyframe.earlier->T_w_c, "SemanticMapper::insert(): the earlier frame's pose");
    check_image(keyframe.earlier->depth, size_, CV_32FC1,
                "SemanticMapper::insert(): the earlier frame's depth image");
    check_image(keyframe.earlier->labels, size_, CV_8UC1,
                "SemanticMapper::insert(): the earlier frame's label image");
  }
  queue_.push(std::move(keyframe));
}

void SemanticMapper::repose(Poses T_w_c) {
  if (!options_.retain_scans) throw UsageError("a map without retained scans cannot follow corrected poses");
  for (const auto& [id, pose] : T_w_c) check_pose(pose, "SemanticMapper::repose(): a pose");
  queue_.push(std::move(T_w_c));
}

void SemanticMapper::finish() {
  queue_.join();
}

void SemanticMapper::work(const std::stop_token& stop) {
  step_back(StepBack::some);
  std::size_t taken = 0;  // jobs whose scans are not all in the tree
  try {
    while (!stop.stop_requested()) {
      std::optional<Job> job;
      if (!behind()) {
        queue_.done(std::exchange(taken, 0));
        job = queue_.pop(stop);
        if (!job) return;
      } else if (options_
                     .retain_scans) {  // scans that are not retained need not pile up: they are fused first
        job = queue_.try_pop();
      }
      if (job) {
        ++taken;
        std::visit([this](auto& what) { run(what); }, *job);
      } else {
        fuse_next();
      }
    }
  } catch (...) {
    queue_.close(std::current_exception());
  }
}

void SemanticMapper::fuse_next() {
  const Retained& keyframe = scans_[fused_];
  scanner_.gather(keyframe.scan, keyframe.T_w_c, voxels_);
  tree_.integrate(voxels_);
  ++fused_;
  check_size();
  if (callback_ && fused_ >= std::min(announced_scans_, scans_.size())) {
    announced_scans_ = fused_;
    callback_(tree_);
  }
  if (!behind() && !options_.retain_scans) {
    scans_.clear();
    fused_ = 0;
  }
  fused_ -= drop_retired(scans_, fused_);
}

void SemanticMapper::check_size() const {
  // A node is an allocation of its own; every third or so has pointers to its children.
  constexpr std::size_t kOverhead = 16 + 80 / 3;
  if (tree_.size() * (tree_.memoryUsageNode() + kOverhead) <= options_.max_bytes) return;
  throw InputError(
      "map", 0,
      fmt::format("takes more than {} MB at voxels of {} m: choose larger ones (--map-resolution), or "
                  "allow more (--map-memory)",
                  options_.max_bytes >> 20U, options_.resolution));
}

void SemanticMapper::take_labels(MapKeyframe& keyframe) const {
  const LabelledView& then = *keyframe.earlier;
  const SE3<float> T_then_now = (then.T_w_c.inverse() * keyframe.T_w_c).cast<float>();
  CarriedLabelsOptions<float> options;
  options.noise = options_.scan.noise;
  cv::Mat labels(size_, CV_8UC1);
  carry_labels(camera_, interop::view<float>(then.depth), interop::view<std::uint8_t>(then.labels),
               interop::view<float>(keyframe.depth), T_then_now, interop::view<std::uint8_t>(labels),
               options);
  // A person may have gone from a place and another thing stand there at the same depth.
  if (options_.scan.mover_label >= 0) labels.setTo(0, labels == options_.scan.mover_label);
  if (!keyframe.labels.empty()) keyframe.labels.copyTo(labels, keyframe.labels);
  keyframe.labels = labels;
}

void SemanticMapper::run(MapKeyframe& keyframe) {
  if (keyframe.earlier) take_labels(keyframe);
  scans_.push_back(
      {keyframe.id, keyframe.T_w_c,
       scanner_.pack(interop::view<float>(keyframe.depth), interop::view<std::uint8_t>(keyframe.dynamic_mask),
                     interop::view<std::uint8_t>(keyframe.labels), BgrView{keyframe.bgr}),
       session_});
  retire_scans(scans_, options_.scans_per_view);
  fused_ -= drop_retired(scans_, fused_);  // the others wait until they are in the tree
}

void SemanticMapper::run(Poses& poses) {
  (void)drop_retired(scans_, scans_.size());
  std::unordered_map<int, SE3<double>> pose_of;
  for (const auto& [id, T_w_c] : poses) pose_of.insert_or_assign(id, T_w_c);
  for (Retained& keyframe : scans_) {
    if (const auto it = pose_of.find(keyframe.id); it != pose_of.end()) keyframe.T_w_c = it->second;
  }
  tree_.clear();
  fused_ = 0;
}

void SemanticMapper::run(Scans& scans) {
  for (const Retained& keyframe : scans) session_ = std::max(session_, keyframe.session + 1);
  scans_.insert(scans_.end(), std::make_move_iterator(scans.begin()), std::make_move_iterator(scans.end()));
}

void SemanticMapper::add_classes(const MapClasses& classes) {
  for (std::uint8_t label = 0; label < kMapLabels; ++label) {
    if (!classes.own(label) || options_.classes.set(label, classes.name(label))) continue;
    throw UsageError(fmt::format("label {} is '{}' in the map that is loaded, and '{}' here", label,
                                 classes.name(label), options_.classes.name(label)));
  }
}

void SemanticMapper::save(const std::filesystem::path& path) const {
  save_map(tree_, path, options_.classes);
}

std::size_t SemanticMapper::retained_bytes() const {
  std::size_t sum = 0;
  for (const Retained& keyframe : scans_) sum += keyframe.scan.bytes();
  return sum;
}

}  // namespace dynslam::runtime
