// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "run_fixture.hpp"
#include "targets.hpp"

namespace dynslam::fuzz {
namespace {

using namespace runtime;
using runtime::Keyframe, runtime::LocalMap, runtime::MapPoint;
namespace fs = std::filesystem;

const fs::path& folder() {
  static const test::TemporaryFolder made;
  return made.path;
}

CameraConfig small_camera() {
  std::istringstream in("width = 64\nheight = 64\nfx = 60\nfy = 60\ncx = 31.5\ncy = 31.5\n");
  return parse_camera(in, "small");
}

/// Puts the size and the check sum right that a damaged file would be refused for: faults hide behind them.
std::string mended(Bytes bytes) {
  std::string file = text_of(bytes);
  const std::size_t line = file.substr(0, 64).find('\n');
  if (line == std::string::npos || file.size() < line + 1 + 20) return file;
  const std::size_t content = line + 1 + 20;
  const std::uint64_t size = file.size() - content;
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a
  for (std::size_t i = content; i < file.size(); ++i)
    hash = (hash ^ static_cast<std::uint8_t>(file[i])) * 1099511628211ULL;
  std::memcpy(file.data() + line + 5, &size, sizeof size);
  std::memcpy(file.data() + line + 13, &hash, sizeof hash);
  return file;
}

void write(const fs::path& path, const std::string& content) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << content;
}

LocalMap small_map() {
  std::vector<Keyframe> keyframes(2);
  std::vector<MapPoint> points(5);
  for (int k = 0; k < 2; ++k) {
    Keyframe& keyframe = keyframes[static_cast<std::size_t>(k)];
    keyframe.id = k;
    keyframe.frame.index = static_cast<std::size_t>(k);
    keyframe.frame.t = k;
    keyframe.frame.T_c_w = SE3<double>(SO3<double>(), Eigen::Vector3d(0.1 * k, 0, 0));
    for (int i = 0; i < 4; ++i) {
      Feature f{};
      f.x = static_cast<float>(12 + 9 * i);
      f.y = static_cast<float>(40 - 5 * i);
      f.depth = 2;
      f.sigma = 1;
      keyframe.frame.features.push_back(f);
      keyframe.frame.descriptors.push_back({});
      keyframe.frame.point.push_back(i);
      keyframe.frame.dynamic.push_back(0);
    }
    keyframe.frame.grid.build(keyframe.frame.features, 64, 64);
  }
  for (int i = 0; i < 4; ++i) {
    MapPoint& p = points[static_cast<std::size_t>(i)];
    p.p_w = {0.1 * i, 0, 2};
    p.viewing = {0, 0, 1};
    p.reference_distance = 2;
    p.information = 100;
    p.visible = p.found = 2;
    p.keyframes = {0, 1};
    if (i > 0) {
      p.patch.level = 0;
      p.patch.keyframe = 0;
      p.patch.depth = 2;
      p.patch.centre = {9, 9};
    }
  }
  points[4].bad = true;
  points[4].merged_into = 0;
  return LocalMap(std::move(keyframes), std::move(points));
}

SemanticMapperOptions coarse() {
  SemanticMapperOptions options;
  options.resolution = 0.2;
  return options;
}

/// A map of two keyframes, saved; made once.
const fs::path& saved() {
  static const fs::path map = [] {
    const CameraConfig camera = small_camera();
    SemanticMapper mapper(camera.model, camera.width, camera.height, coarse());
    for (int k = 0; k < 2; ++k) {
      mapper.insert({SE3<double>(),
                     cv::Mat(64, 64, CV_32FC1, cv::Scalar(1.5 + 0.1 * k)),
                     {},
                     {},
                     cv::Mat(64, 64, CV_8UC3, cv::Scalar(9, 90, 200)),
                     k});
    }
    mapper.finish();
    const fs::path path = folder() / "saved";
    save_slam_map(small_map(), camera, &mapper, path);
    return path;
  }();
  return map;
}

std::vector<std::string> saved_file(const char* name) {
  return {test::bytes(saved() / name)};
}

void keyframes(Bytes bytes) {
  const fs::path map = folder() / "keyframes";
  write(map / "keyframes.bin", mended(bytes));
  try {
    LocalMap loaded = load_slam_map(map, small_camera());
    for (std::size_t k = 0; k < loaded.keyframes().size(); ++k) (void)loaded.pose(static_cast<int>(k));
    for (std::size_t p = 0; p < loaded.points().size(); ++p) (void)loaded.point(static_cast<int>(p));
  } catch (const InputError&) {
  }
}

void scans(Bytes bytes) {
  static const ScanOwner owner = [] {
    ScanOwner of{0, 2};
    (void)load_slam_map(saved(), small_camera(), &of.map_id);
    return of;
  }();
  const fs::path file = folder() / "scans" / "scans.bin";
  write(file, mended(bytes));
  const CameraConfig camera = small_camera();
  try {
    SemanticMapper mapper(camera.model, camera.width, camera.height, coarse());
    (void)mapper.load_scans(file, owner);
    mapper.finish();
  } catch (const InputError&) {
  }
}

void octree(Bytes bytes) {
  const fs::path file = folder() / "octree" / "map.sot";
  write(file, text_of(bytes));
  try {
    (void)load_map(file);
  } catch (const InputError&) {
  }
}

}  // namespace

void add_map_targets(std::vector<Target>& targets) {
  targets.push_back({"keyframes", keyframes, [] { return saved_file("keyframes.bin"); }});
  targets.push_back({"scans", scans, [] { return saved_file("scans.bin"); }});
  // Without its check sum, as dynslam 0.1.0 wrote it: else whatever is changed is refused for that alone.
  targets.push_back({"octree", octree, [] {
                       constexpr std::size_t kSum = 16;  // bytes
                       std::vector<std::string> file = saved_file("map.sot");
                       file[0].resize(file[0].size() - kSum);
                       return file;
                     }});
}

}  // namespace dynslam::fuzz
