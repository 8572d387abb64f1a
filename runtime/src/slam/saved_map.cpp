// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/saved_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <system_error>
#include <utility>
#include <vector>

#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "io/binary_file.hpp"
#include "io/folder_draft.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kKeyframesMagic = "dynslam keyframes";
constexpr std::uint32_t kKeyframesVersion = 1;
constexpr int kMaxOctave = FeatureOptions{}.levels - 1;
constexpr float kFarPixel = 1e6F;  // a lens puts the corners of no image further out

constexpr const char *kKeyframes = "keyframes.bin", *kScans = "scans.bin";
constexpr std::array<std::string_view, 4> kMapFiles{kKeyframes, kScans, kMapFile, kEarlierMapFile};

// What is written as a block of memory.
static_assert(std::is_trivially_copyable_v<Feature> && sizeof(Feature) == 32);
static_assert(std::is_trivially_copyable_v<Descriptor> && sizeof(Descriptor) == 32);

void put(BinaryWriter& out, const CameraConfig& camera) {
  const auto& pinhole = camera.model.pinhole();
  out.put(static_cast<std::int32_t>(camera.width));
  out.put(static_cast<std::int32_t>(camera.height));
  for (const double k : {pinhole.fx(), pinhole.fy(), pinhole.cx(), pinhole.cy()}) out.put(k);
  // The lens by what it does: where three pixels go.
  for (const auto& x :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(camera.width, 0), Eigen::Vector2d(0, camera.height)}) {
    const Eigen::Vector2d y = camera.model.distort_pixel(x).value_or(Eigen::Vector2d(-1, -1));
    out.put(y.x());
    out.put(y.y());
  }
}

void put(BinaryWriter& out, const Keyframe& k) {
  out.put(static_cast<std::uint64_t>(k.frame.index));
  out.put(k.frame.t);
  out.put(k.frame.T_c_w);
  out.put(static_cast<std::int32_t>(k.parent));
  out.put(k.T_c_parent);
  out.put(k.frame.features);
  out.put(k.frame.descriptors);
  out.put(k.frame.point);
  out.put(k.frame.dynamic);
}

void put(BinaryWriter& out, const MapPoint& p) {
  out.put(static_cast<std::uint8_t>(p.bad ? 1 : 0));
  out.put(static_cast<std::int32_t>(p.merged_into));
  if (p.bad) return;
  out.put(p.p_w);
  out.put(p.viewing);
  for (const std::uint64_t word : p.descriptor) out.put(word);
  out.put(static_cast<std::int32_t>(p.patch.level));
  if (p.patch.level >= 0) {
    out.put(std::string_view(reinterpret_cast<const char*>(p.patch.grey.data()), p.patch.grey.size()));
    for (const float x :
         {p.patch.centre.x(), p.patch.centre.y(), p.patch.ideal.x(), p.patch.ideal.y(), p.patch.depth})
      out.put(x);
    out.put(static_cast<std::int32_t>(p.patch.keyframe));
  }
  out.put(p.information);
  out.put(p.reference_distance);
  for (const int n : {p.reference_octave, p.visible, p.found, p.on_mover})
    out.put(static_cast<std::int32_t>(n));
  out.put(p.keyframes);
}

Keyframe get_keyframe(BinaryReader& in, int id, int count, int points, const CameraConfig& camera) {
  Keyframe k;
  k.id = id;
  k.frame.index = static_cast<std::size_t>(in.get<std::uint64_t>());
  k.frame.t = in.get<double>();
  k.frame.T_c_w = in.get<SE3<double>>();
  k.parent = in.get<std::int32_t>();
  k.T_c_parent = in.get<SE3<double>>();
  in.get(k.frame.features);
  in.get(k.frame.descriptors);
  in.get(k.frame.point);
  in.get(k.frame.dynamic);
  const std::size_t n = k.frame.features.size();
  in.require(std::isfinite(k.frame.t) && k.parent >= -1 && k.parent < count && k.parent != id &&
                 k.frame.descriptors.size() == n && k.frame.point.size() == n && k.frame.dynamic.size() == n,
             "holds a keyframe that contradicts itself");
  for (std::size_t i = 0; i < n; ++i) {
    const Feature& f = k.frame.features[i];
    in.require(std::abs(f.x) < kFarPixel && std::abs(f.y) < kFarPixel && std::isfinite(f.depth) &&
                   f.sigma > 0 && f.octave >= 0 && f.octave <= kMaxOctave && k.frame.point[i] >= -1 &&
                   k.frame.point[i] < points,
               "holds a feature that cannot be");
  }
  k.frame.grid.build(k.frame.features, camera.width, camera.height);
  return k;
}

MapPoint get_point(BinaryReader& in, int keyframes, int points) {
  MapPoint p;
  p.bad = in.get<std::uint8_t>() != 0;
  p.merged_into = in.get<std::int32_t>();
  in.require(p.merged_into >= -1 && p.merged_into < points, "holds a map point that contradicts itself");
  if (p.bad) return p;
  p.p_w = in.get<Eigen::Vector3d>();
  p.viewing = in.get<Eigen::Vector3d>();
  for (auto& word : p.descriptor) word = in.get<std::uint64_t>();
  const auto level = in.get<std::int32_t>();
  in.require(level >= -1 && level <= kMaxOctave, "holds a patch that cannot be");
  p.patch.level = static_cast<std::int16_t>(level);
  if (level >= 0) {
    const auto grey = in.get<std::string>();
    in.require(grey.size() == p.patch.grey.size(), "holds a patch that cannot be");
    std::memcpy(p.patch.grey.data(), grey.data(), grey.size());
    for (float* x :
         {&p.patch.centre.x(), &p.patch.centre.y(), &p.patch.ideal.x(), &p.patch.ideal.y(), &p.patch.depth}) {
      *x = in.get<float>();
      in.require(std::isfinite(*x), "holds a patch that cannot be");
    }
    const auto half = static_cast<float>(PointPatch::kSide);
    p.patch.keyframe = in.get<std::int32_t>();
    in.require(p.patch.keyframe >= 0 && p.patch.keyframe < keyframes && p.patch.centre.minCoeff() >= 0 &&
                   p.patch.centre.maxCoeff() < half,
               "holds a patch that cannot be");
  }
  p.information = in.get<double>();
  p.reference_distance = in.get<float>();
  for (int* n : {&p.reference_octave, &p.visible, &p.found, &p.on_mover}) *n = in.get<std::int32_t>();
  in.get(p.keyframes);
  in.require(
      std::all_of(p.keyframes.begin(), p.keyframes.end(), [&](int k) { return k >= 0 && k < keyframes; }) &&
          !p.keyframes.empty() && p.reference_distance > 0 && std::isfinite(p.reference_distance) &&
          p.reference_octave >= 0 && p.reference_octave <= kMaxOctave && p.information >= 0 &&
          std::isfinite(p.information) && p.visible >= 0 && p.found >= 0 && p.on_mover >= 0,
      "holds a map point that contradicts itself");
  return p;
}

/// Whether chains of references end. Each link is followed once.
/// @param next  of an index; < 0: the end
template <class Next>
bool chains_end(std::size_t count, Next&& next) {
  std::vector<bool> ends(count, false);
  std::vector<std::size_t> chain;
  for (std::size_t i = 0; i < count; ++i) {
    chain.clear();
    for (int at = static_cast<int>(i); at >= 0 && !ends[static_cast<std::size_t>(at)];
         at = next(static_cast<std::size_t>(at))) {
      chain.push_back(static_cast<std::size_t>(at));
      if (chain.size() > count) return false;
    }
    for (const std::size_t k : chain) ends[k] = true;
  }
  return true;
}

}  // namespace

void check_map_folder(const fs::path& folder) {
  std::error_code error;
  if (restore_folder(folder, kMapFiles) &&
      !(fs::is_directory(folder) && (fs::is_empty(folder, error) || fs::exists(folder / kKeyframes))))
    throw InputError(folder.string(), 0, "is not a saved map and would be replaced");
  const FolderDraft probe(folder, kMapFiles);  // tells now what would fail at the end
}

void save_slam_map(const LocalMap& map, const CameraConfig& camera, const SemanticMapper* mapper,
                   const fs::path& folder, const SavedScans& otherwise, const std::vector<int>& names) {
  check_map_folder(folder);
  BinaryWriter out;
  put(out, camera);
  out.put(static_cast<std::uint64_t>(map.keyframes().size()));
  out.put(static_cast<std::uint64_t>(map.points().size()));
  for (const Keyframe& k : map.keyframes()) put(out, k);
  for (const MapPoint& p : map.points()) put(out, p);
  FolderDraft draft(folder, kMapFiles);
  const std::uint64_t id = write_binary(draft.path() / kKeyframes, kKeyframesMagic, kKeyframesVersion, out);
  if (mapper != nullptr) {
    mapper->save_scans(draft.path() / kScans, id, names);
    mapper->save(draft.path() / kMapFile);
  } else if (!otherwise.folder.empty() && fs::exists(otherwise.folder / kScans)) {
    copy_scans(otherwise.folder / kScans, otherwise.map_id, draft.path() / kScans, id);
    const fs::path octree = map_file_in(otherwise.folder);
    if (fs::exists(octree)) {
      (void)load_map(octree);  // what is copied is a map
      write_file(draft.path() / kMapFile, read_file(octree, std::numeric_limits<std::uint64_t>::max()));
    }
  }
  draft.publish();
  clear_leftovers(folder, kMapFiles);
}

LocalMap load_slam_map(const fs::path& folder, const CameraConfig& camera, std::uint64_t* map_id) {
  if (!restore_folder(folder, kMapFiles) || !fs::is_directory(folder))
    throw InputError(folder.string(), 0, "is not a folder with a saved map");
  BinaryReader in = read_binary(folder / kKeyframes, kKeyframesMagic, kKeyframesVersion, kKeyframesVersion);
  in.require(fs::exists(folder / kScans) || !fs::exists(map_file_in(folder)),
             "has an octree beside it, but not the scans that it was made of (scans.bin)");
  BinaryWriter expected;
  put(expected, camera);
  for (const char c : expected.bytes())
    in.require(in.get<char>() == c,
               "was made with another camera: sizes, focal lengths or distortion differ");
  const std::size_t keyframes = in.count(16), points = in.count(5);
  std::vector<Keyframe> all_keyframes;
  std::vector<MapPoint> all_points;
  for (std::size_t k = 0; k < keyframes; ++k)
    all_keyframes.push_back(
        get_keyframe(in, static_cast<int>(k), static_cast<int>(keyframes), static_cast<int>(points), camera));
  for (std::size_t p = 0; p < points; ++p)
    all_points.push_back(get_point(in, static_cast<int>(keyframes), static_cast<int>(points)));
  in.finish();
  in.require(!all_keyframes.empty() && !all_keyframes[0].culled(), "holds no keyframe");
  in.require(
      chains_end(keyframes, [&](std::size_t k) { return all_keyframes[k].parent; }) &&
          chains_end(points,
                     [&](std::size_t p) { return all_points[p].bad ? all_points[p].merged_into : -1; }),
      "holds references that go in circles");
  if (map_id != nullptr) *map_id = in.hash();
  return LocalMap(std::move(all_keyframes), std::move(all_points));
}

}  // namespace dynslam::runtime
