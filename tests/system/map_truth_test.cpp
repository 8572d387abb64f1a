// SPDX-License-Identifier: BSD-3-Clause
// Maps of the synthetic office against its geometry: what is there is mapped, who walked through is not.
#include <doctest/doctest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>
#include <unordered_set>

#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "map_truth.hpp"
#include "tum_cameras.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr int kWidth = 640, kHeight = 480;
SE3<double> look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - eye).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return {SO3<double>(R), eye};
}

/// Handheld: half an arc around the desks.
SE3<double> camera_at(double t) {
  const double a = 0.5 * std::sin(0.7 * t);
  return look_at({2.6 * std::sin(a), 2.6 - 2.9 * std::cos(a), 1.35 + 0.25 * std::sin(0.9 * t)},
                 {0.3 * std::sin(1.1 * t), 2.5, 0.8});
}

/// Depth as the sensor measures it [m].
cv::Mat noisy_depth(const synth::Rendering& exact, std::uint64_t seed) {
  synth::Random random(seed);
  cv::Mat raw = synth::sense_depth(exact, test::kFreiburg3.fx(), 1, random), depth;
  raw.convertTo(depth, CV_32FC1, 1.0 / 5000);
  depth.setTo(std::numeric_limits<double>::quiet_NaN(), raw == 0);
  return depth;
}

double mapped_range() {
  const SemanticMapperOptions options;
  return options.scan.range(options.resolution);
}

void report(const std::string& what, const test::MapScore& s) {
  MESSAGE(what << ": occupied " << s.occupied << " precision " << s.precision() << " (exact voxel "
               << s.precision_exact() << ") recall " << s.recall() << " (exact voxel " << s.recall_exact()
               << ") ghosts " << s.ghosts() << " chair " << s.label_recall(Label::chair) << "/"
               << s.label_precision(Label::chair) << " of " << s.truth_of[2] << " display "
               << s.label_recall(Label::display) << "/" << s.label_precision(Label::display) << " of "
               << s.truth_of[3]);
}

}  // namespace

TEST_CASE("a walking sequence: surfaces are mapped, labels are right, walkers leave nothing behind") {
  SynthOptions synth_options;
  synth_options.seed = 5;
  synth_options.walkers = 2;
  const synth::Scene scene(synth_options);
  SemanticMapper mapper(PinholeBrownConrady<double>(test::kFreiburg3), kWidth, kHeight,
                        SemanticMapperOptions());
  test::MapTruth truth(mapper.tree().grid());
  truth.add_static(scene.triangles(0.0));
  const cv::Mat margin = cv::getStructuringElement(cv::MORPH_RECT, {15, 15});  // the pipeline's
  for (int i = 0; i < 16; ++i) {
    const double t = 0.45 * i;
    const auto triangles = scene.triangles(t);
    const SE3<double> T_w_c = camera_at(t);
    const auto exact =
        synth::render(triangles, scene.textures(), test::kFreiburg3, T_w_c.inverse(), kWidth, kHeight);
    truth.add_instant(triangles, exact, test::kFreiburg3, T_w_c, mapped_range());
    for (double dt = 0.05; dt < 0.45; dt += 0.05) truth.add_movers(scene.triangles(t + dt));
    cv::Mat movers;
    cv::dilate(exact.dynamic | (exact.label == static_cast<int>(Label::person)), movers, margin);
    mapper.insert(
        {T_w_c, noisy_depth(exact, static_cast<std::uint64_t>(i)), movers, exact.label, exact.bgr, i});
  }
  mapper.finish();
  const test::MapScore s = truth.score(mapper.tree());
  report("walking", s);
  CHECK(s.occupied > 5000);
  CHECK(s.observed > 5000);
  CHECK(s.precision() >= 0.95);
  CHECK(s.recall() >= 0.90);
  CHECK(s.ghosts() <= 0.005);
  for (const Label label : {Label::chair, Label::display}) {
    CHECK(s.truth_of[static_cast<std::size_t>(label)] > 50);
    CHECK(s.label_recall(label) >= 0.9);
    CHECK(s.label_precision(label) >= 0.9);
  }
}

TEST_CASE("a person who stood there unmasked and left is gone; a chair pushed aside is where it is now") {
  SynthOptions synth_options;
  synth_options.seed = 5;
  synth_options.walkers = 1;
  synth_options.box = false;
  const synth::Scene scene(synth_options);
  constexpr double kStand = 1.0;
  const Eigen::Vector3d push(-0.75, -0.15, 0);
  const auto at = [&](double t, bool pushed) {
    auto triangles = scene.triangles(t);
    for (auto& triangle : triangles) {  // the chair in the middle
      if (!pushed || triangle.label != Label::chair || std::abs(triangle.p[0].x() - 0.4) > 0.7) continue;
      for (auto& p : triangle.p) p += push;
    }
    return triangles;
  };
  SemanticMapper mapper(PinholeBrownConrady<double>(test::kFreiburg3), kWidth, kHeight,
                        SemanticMapperOptions());
  const VoxelGrid grid = mapper.tree().grid();
  using Voxels = std::unordered_set<PackedKey>;
  const auto voxels_of = [&](bool pushed, auto&& wanted) {
    Voxels set;
    for (const auto& triangle : at(kStand, pushed)) {
      if (!wanted(triangle)) continue;
      test::sample_triangle(triangle, 0.02,
                            [&](const Eigen::Vector3d& p) { set.insert(pack(*grid.key(p))); });
    }
    return set;
  };
  const auto without = [](Voxels set, const Voxels& others) {
    std::erase_if(set, [&](PackedKey k) { return others.contains(k); });
    return set;
  };
  const auto is_chair = [](const synth::Triangle& t) { return t.label == Label::chair; };
  const auto furniture =
      voxels_of(true, [](const synth::Triangle& t) { return !t.dynamic && t.label != Label::person; });
  const Voxels person =
      without(voxels_of(false, [](const synth::Triangle& t) { return t.dynamic; }), furniture);
  const Voxels left = without(voxels_of(false, is_chair), furniture);
  const Voxels arrived = without(voxels_of(true, is_chair), voxels_of(false, is_chair));
  const auto occupied = [&](const Voxels& set, int label) {
    int n = 0;
    for (const PackedKey k : set) {
      const MapVoxel v = mapper.tree().at(unpack(k));
      n += v.state == Occupancy::occupied && (label < 0 || v.label == label) ? 1 : 0;
    }
    return n;
  };
  const auto insert = [&](int i, double t, bool pushed, bool masked) {
    const auto triangles = at(t, pushed);
    const SE3<double> T_w_c = camera_at(0.3 * (i % 6));  // the place stays in view
    const auto exact =
        synth::render(triangles, scene.textures(), test::kFreiburg3, T_w_c.inverse(), kWidth, kHeight);
    cv::Mat movers = cv::Mat::zeros(kHeight, kWidth, CV_8UC1), labels = exact.label.clone();
    if (masked) {
      cv::dilate(exact.dynamic, movers, cv::Mat::ones(15, 15, CV_8UC1));
    } else {
      labels.setTo(0, exact.dynamic);  // the network missed the person
    }
    mapper.insert({T_w_c, noisy_depth(exact, static_cast<std::uint64_t>(i)), movers, labels, exact.bgr, i});
  };

  for (int i = 0; i < 4; ++i) insert(i, kStand, false, false);
  mapper.finish();
  const int stood = occupied(person, -1), chair_was = occupied(left, 2);
  CHECK(stood > 150);
  CHECK(chair_was > 25);
  CHECK(occupied(arrived, 2) < 5);
  // Four hits ask for nine misses: OctoMap's sensor model.
  for (int i = 4; i < 20; ++i) insert(i, kStand + 2.2 + 0.1 * i, true, true);
  mapper.finish();
  MESSAGE("person " << stood << " -> " << occupied(person, -1) << ", old chair " << chair_was << " -> "
                    << occupied(left, 2) << ", new chair " << occupied(arrived, 2) << " of "
                    << arrived.size());
  CHECK(occupied(person, -1) <= 0.02 * stood);
  CHECK(occupied(left, 2) <= 0.05 * chair_was);
  CHECK(occupied(arrived, 2) > 25);
}

// Not run by default, for it takes its time: --no-skip -tc="the whole pipeline*".
TEST_CASE("the whole pipeline on a walking sequence, at its own poses" * doctest::skip()) {
  const test::TemporaryFolder folder;
  SynthOptions synth_options;
  synth_options.seed = 2;
  synth_options.path = "xyz";
  synth_options.frames = 120;
  synthesize(synth_options, folder.path / "sequence");
  RunOptions run;
  run.sequence = folder.path / "sequence";
  run.masks = folder.path / "sequence" / "label";
  run.out = folder.path / "out";
  const std::atomic<bool> stop{false};
  (void)run_sequence(run, stop);

  const auto tree = load_map(run.out / "map.sot");
  const Sequence sequence = load_sequence(run.sequence);
  const CameraConfig camera = load_camera(sequence.camera_hint);
  // The map's frame is the first camera.
  const SE3<double> T_c0_w = sequence.groundtruth.front().T_w_c.inverse();
  const synth::Scene scene(synth_options);
  const auto triangles_at = [&](double t) {
    auto triangles = scene.triangles(t);
    for (auto& triangle : triangles) {
      for (auto& p : triangle.p) p = T_c0_w * p;
    }
    return triangles;
  };
  test::MapTruth truth(tree->grid());
  truth.add_static(triangles_at(0.0));
  const Pinhole<double>& pinhole = camera.model.pinhole();
  for (std::size_t i = 0; i < sequence.groundtruth.size(); i += 2) {
    const auto triangles = triangles_at(static_cast<double>(i) / synth_options.fps);
    const SE3<double> T = T_c0_w * sequence.groundtruth[i].T_w_c;
    const auto exact =
        synth::render(triangles, scene.textures(), pinhole, T.inverse(), camera.width, camera.height);
    truth.add_instant(triangles, exact, pinhole, T, mapped_range());
  }
  const test::MapScore s = truth.score(*tree);
  report("whole pipeline", s);
  CHECK(s.precision() >= 0.90);  // with surfaces whose noise is a voxel's edge
  CHECK(s.recall() >= 0.90);
  CHECK(s.ghosts() <= 0.005);
  CHECK(s.label_recall(Label::chair) >= 0.9);
  CHECK(s.label_recall(Label::display) >= 0.9);
}
