// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/semantic_mapper.hpp"

#include <cstdint>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "dynslam/interop/octomap.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "io/binary_file.hpp"
#include "slam/thread_priority.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::string_view kMagic = "dynslam scans";
constexpr std::uint32_t kVersion = 1;

}  // namespace

SemanticMapper::SemanticMapper(const PinholeBrownConrady<double>& camera, int width, int height,
                               const SemanticMapperOptions& options)
    : options_(options),
      scanner_(camera, width, height, options.scan),
      tree_(options.resolution),
      voxels_(tree_.grid()) {
  interop::set_parameters(tree_, options_.occupancy);
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void SemanticMapper::insert(MapKeyframe keyframe) {
  enqueue(std::move(keyframe));
}

void SemanticMapper::repose(Poses T_w_c) {
  if (!options_.retain_scans) throw UsageError("a map without retained scans cannot follow corrected poses");
  enqueue(std::move(T_w_c));
}

void SemanticMapper::enqueue(Job job) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return queue_.size() < options_.queue || failure_; });
  if (failure_) std::rethrow_exception(failure_);
  queue_.push_back(std::move(job));
  changed_.notify_all();
}

void SemanticMapper::finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return (queue_.empty() && !busy_) || failure_; });
  if (failure_) std::rethrow_exception(failure_);
}

void SemanticMapper::work(const std::stop_token& stop) {
  step_back(StepBack::some);
  for (;;) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return !queue_.empty(); })) return;
      job = std::move(queue_.front());
      queue_.pop_front();
      busy_ = true;
      changed_.notify_all();
    }
    std::exception_ptr failure;
    try {
      std::visit([this](auto& what) { run(what); }, job);
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    busy_ = false;
    if (failure) failure_ = failure;
    changed_.notify_all();
    if (failure) return;
  }
}

void SemanticMapper::run(MapKeyframe& keyframe) {
  MapScan scan = scanner_.pack(keyframe.depth, keyframe.dynamic_mask, keyframe.labels, keyframe.bgr);
  fuse(scan, keyframe.T_w_c);
  if (options_.retain_scans) retained_.push_back({keyframe.id, keyframe.T_w_c, std::move(scan)});
}

void SemanticMapper::run(Poses& poses) {
  std::unordered_map<int, SE3<double>> pose_of;
  for (const auto& [id, T_w_c] : poses) pose_of.insert_or_assign(id, T_w_c);
  tree_.clear();
  for (Retained& keyframe : retained_) {
    if (const auto it = pose_of.find(keyframe.id); it != pose_of.end()) keyframe.T_w_c = it->second;
    fuse(keyframe.scan, keyframe.T_w_c);
  }
}

void SemanticMapper::run(Scans& scans) {
  for (Retained& keyframe : scans) {
    fuse(keyframe.scan, keyframe.T_w_c);
    if (options_.retain_scans) retained_.push_back(std::move(keyframe));
  }
}

std::vector<std::pair<int, SE3<double>>> SemanticMapper::load_scans(const std::filesystem::path& path) {
  BinaryReader in = read_binary(path, kMagic, kVersion);
  Scans scans;
  Poses poses;
  const std::size_t n = in.count(16);
  for (std::size_t k = 0; k < n; ++k) {
    const int id = in.get<std::int32_t>();
    const auto T_w_c = in.get<SE3<double>>();
    scans.push_back({id, T_w_c, MapScan::read(in, scanner_.samples())});
    poses.emplace_back(id, T_w_c);
  }
  in.finish();
  enqueue(std::move(scans));
  return poses;
}

void SemanticMapper::save_scans(const std::filesystem::path& path) const {
  BinaryWriter out;
  out.put(static_cast<std::uint64_t>(retained_.size()));
  for (const Retained& keyframe : retained_) {
    out.put(static_cast<std::int32_t>(keyframe.id));
    out.put(keyframe.T_w_c);
    keyframe.scan.write(out);
  }
  write_binary(path, kMagic, kVersion, out);
}

void SemanticMapper::fuse(const MapScan& scan, const SE3<double>& T_w_c) {
  scanner_.gather(scan, T_w_c, voxels_);
  tree_.integrate(voxels_);
}

void SemanticMapper::save(const std::filesystem::path& path) const {
  save_map(tree_, path);
}

std::size_t SemanticMapper::retained_bytes() const {
  std::size_t sum = 0;
  for (const Retained& keyframe : retained_) sum += keyframe.scan.bytes();
  return sum;
}

}  // namespace dynslam::runtime
