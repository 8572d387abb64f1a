// SPDX-License-Identifier: BSD-3-Clause
// The file of a map's scans, scans.bin: from them the octree is made again when poses are corrected.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "io/binary_file.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::string_view kScansMagic = "dynslam scans";
constexpr std::uint32_t kScansVersion = 3;
constexpr std::uint32_t kUnnamed = 1;  // did not name the keyframes that the scans belong to
constexpr std::uint32_t kCounted = 2;  // the last one with depth in fifths of a millimetre
constexpr std::int32_t kMostSessions = 1 << 30;
constexpr int kVisits = 2;  // later sessions that make up for a scan

/// @param sessions  one per scan; empty for version 1
/// @return the file behind these
BinaryReader open_scans(const std::filesystem::path& path, std::uint64_t map_id,
                        std::vector<std::int32_t>& sessions) {
  BinaryReader in = read_binary(path, kScansMagic, kScansVersion, kUnnamed);
  in.require(in.version() == kUnnamed || in.get<std::uint64_t>() == map_id,
             "belongs to other keyframes than those beside it");
  if (in.version() != kUnnamed) in.get(sessions);
  return in;
}

void write_scan(BinaryWriter& out, const MapScan& scan) {
  out.put(scan.depth);
  out.put(scan.code);
  out.put(scan.rgb);
}

/// @param samples  pixels that the camera's scans have; none: any number
MapScan read_scan(BinaryReader& in, std::optional<std::size_t> samples) {
  MapScan scan;
  in.get(scan.depth);
  in.get(scan.code);
  in.get(scan.rgb);
  in.require(!samples || (scan.depth.size() == *samples && scan.code.size() == *samples),
             "holds scans of another camera");
  in.require(scan.consistent(), "holds a scan that cannot be");
  if (in.version() <= kCounted) {
    for (std::uint16_t& z : scan.depth) z = DepthCode::of(static_cast<float>(z) / 5000.0F).bits;
  }
  return scan;
}

}  // namespace

std::vector<std::pair<int, SE3<double>>> SemanticMapper::load_scans(const std::filesystem::path& path,
                                                                    const ScanOwner& owner) {
  std::vector<std::int32_t> sessions;
  BinaryReader in = open_scans(path, owner.map_id, sessions);
  Scans scans;
  Poses poses;
  const std::size_t n = in.count(16);
  sessions.resize(in.version() == kUnnamed ? n : sessions.size(), 0);
  in.require(sessions.size() == n, "contradicts itself");
  for (std::size_t k = 0; k < n; ++k) {
    const int id = in.get<std::int32_t>();
    in.require(id >= 0 && id < owner.keyframes, "holds a scan of a keyframe that is not in the map");
    const auto T_w_c = in.get<SE3<double>>();
    in.require(sessions[k] >= 0 && sessions[k] < kMostSessions, "holds a scan of no session");
    scans.push_back({id, T_w_c, read_scan(in, scanner_.samples()), sessions[k]});
    poses.emplace_back(id, T_w_c);
  }
  in.finish();
  queue_.push(std::move(scans));
  return poses;
}

void copy_scans(const std::filesystem::path& from, std::uint64_t from_id, const std::filesystem::path& to,
                std::uint64_t to_id) {
  std::vector<std::int32_t> sessions;
  BinaryReader in = open_scans(from, from_id, sessions);
  if (in.version() == kUnnamed) sessions.assign(BinaryReader(in).count(16), 0);
  BinaryWriter out;
  out.put(to_id);
  out.put(sessions);
  if (in.version() == kScansVersion) {
    out.put_bytes(in.rest());
  } else {
    const std::size_t n = in.count(16);
    out.put(static_cast<std::uint64_t>(n));
    for (std::size_t k = 0; k < n; ++k) {
      out.put(in.get<std::int32_t>());
      out.put(in.get<SE3<double>>());
      write_scan(out, read_scan(in, std::nullopt));
    }
  }
  write_binary(to, kScansMagic, kScansVersion, out);
}

void SemanticMapper::save_scans(const std::filesystem::path& path, std::uint64_t map_id,
                                const std::vector<int>& names) const {
  const std::vector<bool> needed = still_needed();
  std::vector<std::int32_t> sessions;
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    if (needed[k]) sessions.push_back(scans_[k].session);
  }
  BinaryWriter out;
  out.put(map_id);
  out.put(sessions);
  out.put(static_cast<std::uint64_t>(sessions.size()));
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    if (!needed[k]) continue;
    const Retained& keyframe = scans_[k];
    out.put(static_cast<std::int32_t>(names.empty() ? keyframe.id
                                                    : names.at(static_cast<std::size_t>(keyframe.id))));
    out.put(keyframe.T_w_c);
    write_scan(out, keyframe.scan);
  }
  write_binary(path, kScansMagic, kScansVersion, out);
}

std::vector<int> SemanticMapper::saved_keyframes() const {
  const std::vector<bool> needed = still_needed();
  std::vector<int> ids;
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    if (needed[k]) ids.push_back(scans_[k].id);
  }
  return ids;
}

std::vector<bool> SemanticMapper::still_needed() const {
  std::vector<bool> needed(scans_.size(), true);
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    int visits = 0, last = scans_[k].session;
    for (std::size_t later = k + 1; later < scans_.size() && visits < kVisits; ++later) {
      // In the order of their sessions, as they were saved.
      if (scans_[later].session <= last || !same_view(scans_[k].T_w_c, scans_[later].T_w_c)) continue;
      last = scans_[later].session;
      ++visits;
    }
    needed[k] = visits < kVisits;
  }
  return needed;
}

}  // namespace dynslam::runtime
