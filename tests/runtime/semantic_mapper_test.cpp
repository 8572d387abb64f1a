// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/semantic_mapper.hpp"

#include <doctest/doctest.h>

#include <chrono>
#include <fstream>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

#include "dynslam/interop/octomap.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/semantic/map_query.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const PinholeBrownConrady<double> kMapCamera(Pinhole<double>(100, 100, 80, 60));
const cv::Rect kBlock(60, 40, 40, 40);

/// A wall at 2 m; a block in its middle at 1 m.
MapKeyframe keyframe(bool block, Label block_label, bool masked) {
  MapKeyframe k;
  k.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(2.0));
  k.bgr = cv::Mat(120, 160, CV_8UC3, cv::Scalar(10, 100, 200));
  k.labels = cv::Mat::zeros(120, 160, CV_8UC1);
  k.dynamic_mask = cv::Mat::zeros(120, 160, CV_8UC1);
  if (block) {
    k.depth(kBlock) = 1.0;
    k.labels(kBlock) = static_cast<std::uint8_t>(block_label);
    if (masked) k.dynamic_mask(kBlock) = 255;
  }
  return k;
}

SE3<double> moved(double x, double turn) {
  return {SO3<double>::exp(Eigen::Vector3d(0, turn, 0)), Eigen::Vector3d(x, 0, 0)};
}

MapVoxel voxel(const SemanticMapper& mapper, double x, double y, double z) {
  return query_point(mapper.tree(), {x, y, z});
}
Occupancy at(const SemanticMapper& mapper, double x, double y, double z) {
  return voxel(mapper, x, y, z).state;
}

std::string bytes(const SemanticMapper& mapper) {
  std::ostringstream out;
  mapper.tree().writeData(out);
  return out.str();
}

}  // namespace

TEST_CASE("surfaces become occupied, rays free, the rest stays unknown; colours are kept") {
  SemanticMapper mapper(kMapCamera, 160, 120, {});
  mapper.insert(keyframe(false, Label::background, false));
  mapper.finish();
  CHECK(at(mapper, 0.02, 0.02, 2.01) == Occupancy::occupied);
  CHECK(at(mapper, 0.02, 0.02, 1.02) == Occupancy::free);
  CHECK(at(mapper, 0.02, 0.02, 2.52) == Occupancy::unknown);
  const auto* node = mapper.tree().search(0.02, 0.02, 2.01);
  REQUIRE(node != nullptr);
  CHECK(node->colour() == Rgb{200, 100, 10});
}

TEST_CASE("people and masked pixels never enter the map; chairs and displays carry their label") {
  for (const bool masked : {false, true}) {
    SemanticMapper mapper(kMapCamera, 160, 120, {});
    mapper.insert(keyframe(true, masked ? Label::background : Label::person, masked));
    mapper.finish();
    CHECK(at(mapper, 0.02, 0.02, 1.01) != Occupancy::occupied);
    CHECK(at(mapper, 1.0, 0.02, 2.01) == Occupancy::occupied);
    // The way to a mover is free; where it is and behind it nothing is known.
    CHECK(at(mapper, 0.02, 0.02, 0.5) == Occupancy::free);
    CHECK(at(mapper, 0.02, 0.02, 1.02) == Occupancy::unknown);
    CHECK(at(mapper, 0.02, 0.02, 1.52) == Occupancy::unknown);
  }
  for (const Label label : {Label::chair, Label::display}) {
    SemanticMapper mapper(kMapCamera, 160, 120, {});
    mapper.insert(keyframe(true, label, false));
    mapper.finish();
    const MapVoxel block = voxel(mapper, 0.02, 0.02, 1.01);
    CHECK(block.state == Occupancy::occupied);
    CHECK(block.label == static_cast<std::uint8_t>(label));
    CHECK(block.confidence == 1.0F);
    CHECK(voxel(mapper, 1.0, 0.02, 2.01).label == 0);
    CHECK(query_point(mapper.tree(), {0.02, 0.02, 1.01}, 2).label == static_cast<std::uint8_t>(label));
  }
}

TEST_CASE("what has left is cleared by the rays that pass where it was") {
  SemanticMapper mapper(kMapCamera, 160, 120, {});
  mapper.insert(keyframe(true, Label::chair, false));
  for (int i = 0; i < 4; ++i) mapper.insert(keyframe(false, Label::background, false));
  mapper.finish();
  CHECK(at(mapper, 0.02, 0.02, 1.01) == Occupancy::free);
  CHECK(voxel(mapper, 0.02, 0.02, 1.01).confidence == 0.0F);
  // A mover that hides the place afterwards brings nothing back, and what is behind it stays.
  mapper.insert(keyframe(true, Label::person, true));
  mapper.finish();
  CHECK(at(mapper, 0.02, 0.02, 1.01) == Occupancy::free);
  CHECK(at(mapper, 0.02, 0.02, 2.01) == Occupancy::occupied);
}

TEST_CASE("depth at edges is not mapped, grazing surfaces neither, far ones count less") {
  MapKeyframe k = keyframe(true, Label::background, false);
  // Flying pixels: between block and wall, as a sensor smears them.
  k.depth(cv::Rect(kBlock.x + kBlock.width, kBlock.y, 1, kBlock.height)) = 1.5;
  SemanticMapperOptions options;
  options.scan.pixel_stride = 1;
  SemanticMapper mapper(kMapCamera, 160, 120, options);
  mapper.insert(k);
  mapper.finish();
  for (double y = -0.25; y < 0.25; y += 0.05) CHECK(at(mapper, 0.302, y, 1.51) != Occupancy::occupied);
  CHECK(at(mapper, 0.02, 0.02, 1.01) == Occupancy::occupied);

  const auto log_odds = [](double z) {
    MapKeyframe wall = keyframe(false, Label::background, false);
    wall.depth = z;
    SemanticMapper m(kMapCamera, 160, 120, {});
    m.insert(wall);
    m.finish();
    return static_cast<double>(voxel(m, 0.02, 0.02, z + 0.005).log_odds);
  };
  CHECK(log_odds(1.5) == doctest::Approx(0.8473).epsilon(1e-3));
  CHECK(log_odds(3.9) < 0.5);
  CHECK(log_odds(3.9) > 0.1);
  CHECK(log_odds(4.2) == 0.0);  // out of range: no surface
}

TEST_CASE("the way to what is out of range is free") {
  MapKeyframe k = keyframe(false, Label::background, false);
  k.depth = 6.0;
  SemanticMapper mapper(kMapCamera, 160, 120, {});
  mapper.insert(k);
  mapper.finish();
  CHECK(at(mapper, 0.02, 0.02, 4.9) == Occupancy::free);  // the range is 5.1 m by the noise
  CHECK(at(mapper, 0.02, 0.02, 5.3) == Occupancy::unknown);
}

TEST_CASE("corrected poses: the map is what it would be had the keyframes come with them") {
  const auto scene = [](int i) {
    MapKeyframe k = keyframe(true, Label::chair, false);
    k.depth += 0.03 * i;
    k.id = 10 + i;
    return k;
  };
  constexpr int kCount = 5;
  const auto corrected = [](int i) { return moved(0.2 * i, 0.1 * i); };
  SemanticMapper direct(kMapCamera, 160, 120, {}), followed(kMapCamera, 160, 120, {});
  std::vector<std::pair<int, SE3<double>>> poses;
  for (int i = 0; i < kCount; ++i) {
    MapKeyframe k = scene(i);
    k.T_w_c = i == 1 ? SE3<double>() : corrected(i);
    direct.insert(k);
    k.T_w_c = SE3<double>();  // drifted
    followed.insert(k);
    if (i != 1) poses.emplace_back(10 + i, corrected(i));  // keyframe 11 is not named: it keeps its pose
    if (i == 2) followed.repose(poses);                    // and what comes later is inserted on top
  }
  poses.emplace_back(99, SE3<double>());  // unknown: ignored
  followed.repose(poses);
  direct.finish();
  followed.finish();
  CHECK(direct.tree().size() > 1000);
  CHECK(bytes(followed) == bytes(direct));
  CHECK(followed.retained_bytes() > 0);
  CHECK(followed.retained_bytes() < 6 * 80 * 60 * kCount + 1);

  SemanticMapperOptions lean;
  lean.retain_scans = false;
  SemanticMapper forgetful(kMapCamera, 160, 120, lean);
  forgetful.insert(scene(0));
  CHECK_THROWS_AS(forgetful.repose({}), UsageError);
  forgetful.finish();
  CHECK(forgetful.retained_bytes() == 0);
}

TEST_CASE("of a view that is scanned again and again a few scans are kept, whenever they are fused") {
  SemanticMapperOptions options;
  options.scans_per_view = 4;
  SemanticMapper hurried(kMapCamera, 160, 120, options), patient(kMapCamera, 160, 120, options);
  std::vector<std::pair<int, SE3<double>>> poses;
  std::size_t one = 0;
  for (int i = 0; i < 24; ++i) {
    MapKeyframe k = keyframe(i % 5 == 0, Label::chair, false);
    k.id = i;
    k.T_w_c = moved(i % 2 == 0 ? 0 : 1, 0);  // two views
    poses.emplace_back(i, moved(i % 2 == 0 ? 0 : 1, 0.02));
    for (SemanticMapper* mapper : {&hurried, &patient}) {
      mapper->insert(k);
      if (i == 9 || i == 17) mapper->repose(poses);
    }
    patient.finish();
    if (i == 0) one = patient.retained_bytes();
  }
  hurried.finish();
  CHECK(patient.retained_bytes() < 10 * one);
  CHECK(patient.retained_bytes() == hurried.retained_bytes());
  CHECK(bytes(patient) == bytes(hurried));
  // Made again from what is kept, the map holds what it held.
  patient.repose(poses);
  patient.finish();
  CHECK(at(patient, 0.02, 0.02, 2.02) == Occupancy::occupied);
  CHECK(patient.saved_keyframes().size() == 8);
}

TEST_CASE("keyframes that come while a corrected map is rebuilt do not wait for it") {
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](Clock::time_point from) {
    return std::chrono::duration<double>(Clock::now() - from).count();
  };
  constexpr int kCount = 120;
  SemanticMapper mapper(kMapCamera, 160, 120, {}), direct(kMapCamera, 160, 120, {});
  std::vector<std::pair<int, SE3<double>>> poses;
  for (int i = 0; i < kCount; ++i) {
    MapKeyframe k = keyframe(true, Label::chair, false);
    k.id = i;
    mapper.insert(k);
    poses.emplace_back(i, moved(0.01 * i, 0.05 * i));
    k.T_w_c = poses.back().second;
    direct.insert(k);
  }
  direct.finish();
  mapper.finish();
  auto start = Clock::now();
  mapper.repose(poses);
  mapper.finish();
  const double rebuilding = seconds(start);
  start = Clock::now();
  mapper.repose(poses);
  for (int i = 0; i < 8; ++i) {
    MapKeyframe k = keyframe(false, Label::background, false);
    k.id = kCount + i;
    mapper.insert(k);
  }
  mapper.repose(poses);  // a further correction does not wait, either
  const double waited = seconds(start);
  CAPTURE(rebuilding);
  CHECK(waited < 0.5 * rebuilding);
  mapper.finish();
  for (int i = 0; i < 8; ++i) direct.insert(keyframe(false, Label::background, false));
  direct.finish();
  CHECK(bytes(mapper) == bytes(direct));
}

TEST_CASE("who wants to know is told of the tree as it grows, and not while it is built again") {
  std::vector<std::size_t> occupied;  // written on the mapper's thread, read after finish()
  const auto told = [&](const interop::SemanticOcTree& tree) {
    std::size_t count = 0;
    for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it)
      count += tree.isNodeOccupied(*it) ? 1U : 0U;
    occupied.push_back(count);
  };
  SemanticMapper mapper(kMapCamera, 160, 120, {}, told), other(kMapCamera, 160, 120, {});
  std::vector<std::pair<int, SE3<double>>> poses;
  for (int i = 0; i < 4; ++i) {
    MapKeyframe k = keyframe(false, Label::background, false);
    k.id = i;
    k.T_w_c = moved(0.6 * i, 0);
    mapper.insert(k);
    mapper.finish();
    CHECK(occupied.size() == static_cast<std::size_t>(i) + 1);
    poses.emplace_back(i, moved(0.6 * i, 0.1));
    other.insert(k);
  }
  for (std::size_t i = 1; i < occupied.size(); ++i) CHECK(occupied[i] > occupied[i - 1]);
  const std::size_t before = occupied.back();
  mapper.repose(poses);
  mapper.finish();
  REQUIRE(occupied.size() == 5);  // once, when all is in it again
  CHECK(occupied.back() > before / 2);
  other.repose(poses);
  other.finish();
  CHECK(bytes(mapper) == bytes(other));
}

TEST_CASE("a saved map reads back with labels; two runs give the same bytes; bad paths are told") {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.sot", "b.sot"}) {
    SemanticMapper mapper(kMapCamera, 160, 120, {});
    for (int i = 0; i < 3; ++i) mapper.insert(keyframe(true, Label::chair, false));
    mapper.finish();
    mapper.save(folder.path / name);
    CHECK_THROWS_AS(mapper.save(folder.path / "no" / "such.ot"), InputError);
  }
  const auto file = [&](const char* name) {
    std::ifstream in(folder.path / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  CHECK(file("a.sot") == file("b.sot"));
  const auto tree = load_map(folder.path / "a.sot");
  CHECK(query_point(*tree, {0.02, 0.02, 1.01}).label == static_cast<std::uint8_t>(Label::chair));
}
