// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/semantic_mapper.hpp"

#include <cstdint>
#include <exception>
#include <iterator>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "dynslam/interop/octomap.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "io/binary_file.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::string_view kMagic = "dynslam scans";
constexpr std::uint32_t kVersion = 2;  // 1 did not name the keyframes that the scans belong to
constexpr std::uint32_t kUnnamed = 1;
static_assert(static_cast<int>(Label::person) == MapScanOptions{}.mover_label);

/// @return the file behind its name for the keyframes
BinaryReader open_scans(const std::filesystem::path& path, std::uint64_t map_id) {
  BinaryReader in = read_binary(path, kMagic, kVersion, kUnnamed);
  in.require(in.version() == kUnnamed || in.get<std::uint64_t>() == map_id,
             "belongs to other keyframes than those beside it");
  return in;
}

}  // namespace

SemanticMapper::SemanticMapper(const PinholeBrownConrady<double>& camera, int width, int height,
                               const SemanticMapperOptions& options)
    : options_(options),
      scanner_(camera, width, height, options.scan),
      tree_(options.resolution),
      voxels_(tree_.grid()),
      queue_(options.queue) {
  interop::set_parameters(tree_, options_.occupancy);
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void SemanticMapper::insert(MapKeyframe keyframe) {
  queue_.push(std::move(keyframe));
}

void SemanticMapper::repose(Poses T_w_c) {
  if (!options_.retain_scans) throw UsageError("a map without retained scans cannot follow corrected poses");
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
  if (!behind() && !options_.retain_scans) {
    scans_.clear();
    fused_ = 0;
  }
}

void SemanticMapper::run(MapKeyframe& keyframe) {
  scans_.push_back(
      {keyframe.id, keyframe.T_w_c,
       scanner_.pack(interop::view<float>(keyframe.depth), interop::view<std::uint8_t>(keyframe.dynamic_mask),
                     interop::view<std::uint8_t>(keyframe.labels), BgrView{keyframe.bgr})});
}

void SemanticMapper::run(Poses& poses) {
  std::unordered_map<int, SE3<double>> pose_of;
  for (const auto& [id, T_w_c] : poses) pose_of.insert_or_assign(id, T_w_c);
  for (Retained& keyframe : scans_) {
    if (const auto it = pose_of.find(keyframe.id); it != pose_of.end()) keyframe.T_w_c = it->second;
  }
  tree_.clear();
  fused_ = 0;
}

void SemanticMapper::run(Scans& scans) {
  scans_.insert(scans_.end(), std::make_move_iterator(scans.begin()), std::make_move_iterator(scans.end()));
}

std::vector<std::pair<int, SE3<double>>> SemanticMapper::load_scans(const std::filesystem::path& path,
                                                                    const ScanOwner& owner) {
  BinaryReader in = open_scans(path, owner.map_id);
  Scans scans;
  Poses poses;
  const std::size_t n = in.count(16);
  for (std::size_t k = 0; k < n; ++k) {
    const int id = in.get<std::int32_t>();
    in.require(id >= 0 && id < owner.keyframes, "holds a scan of a keyframe that is not in the map");
    const auto T_w_c = in.get<SE3<double>>();
    scans.push_back({id, T_w_c, read_scan(in, scanner_.samples())});
    poses.emplace_back(id, T_w_c);
  }
  in.finish();
  queue_.push(std::move(scans));
  return poses;
}

void copy_scans(const std::filesystem::path& from, std::uint64_t from_id, const std::filesystem::path& to,
                std::uint64_t to_id) {
  const BinaryReader in = open_scans(from, from_id);
  BinaryWriter out;
  out.put(to_id);
  out.put_bytes(in.rest());
  write_binary(to, kMagic, kVersion, out);
}

void SemanticMapper::save_scans(const std::filesystem::path& path, std::uint64_t map_id) const {
  BinaryWriter out;
  out.put(map_id);
  out.put(static_cast<std::uint64_t>(scans_.size()));
  for (const Retained& keyframe : scans_) {
    out.put(static_cast<std::int32_t>(keyframe.id));
    out.put(keyframe.T_w_c);
    write_scan(out, keyframe.scan);
  }
  write_binary(path, kMagic, kVersion, out);
}

void SemanticMapper::save(const std::filesystem::path& path) const {
  save_map(tree_, path);
}

std::size_t SemanticMapper::retained_bytes() const {
  std::size_t sum = 0;
  for (const Retained& keyframe : scans_) sum += keyframe.scan.bytes();
  return sum;
}

}  // namespace dynslam::runtime
