// SPDX-License-Identifier: BSD-3-Clause
// Five keyframes of 640 x 480 with depth, colour and labels, the paper's way into its map: which pixels
// become map (every second, away from edges), the voxels that they hit and pass, and these into the semantic
// octree or the voxel block map; beside ColorOcTree with every second pixel (a ray per voxel, no labels). The
// keyframes are recorded ones (fr1_xyz) where DYNSLAM_DATA names the data, views of a wavy wall otherwise.
#include <benchmark/benchmark.h>

#ifdef DYNSLAM_BENCH_OCTOMAP
#include <cmath>
#include <cstdint>
#include <vector>

#include "baselines/color_octree.hpp"
#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/slam/map_scan.hpp"
#include "dynslam/semantic/map_scan.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "recorded_scans.hpp"
#include "support/named.hpp"

namespace {

using namespace dynslam;

constexpr double kEdge = 0.05, kMaxRange = 4.0;

struct Keyframes {
  AnyCamera<double> camera = Pinhole<double>(525, 525, 319.5, 239.5);
  std::vector<cv::Mat> depth, bgr;  // CV_32FC1, CV_8UC3
  std::vector<SE3d> T_w_c;
  Image<std::uint8_t> labels{640, 480};  // of no meaning, in patches; none is people's

  Keyframes() {
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u)
        labels(u, v) = static_cast<std::uint8_t>((u / 160 + v / 160) % 2 == 0 ? 2 : 3);
    }
    const auto folder = test::recorded_sequence("rgbd_dataset_freiburg1_xyz_first200");
    if (!folder) {
      make_up();
      return;
    }
    const runtime::Sequence sequence = runtime::load_sequence(*folder);
    const runtime::CameraConfig config = runtime::load_camera(sequence.camera_hint);
    camera = config.model;
    for (std::size_t k = 0; k < 5; ++k) {
      const auto& record = sequence.frames[k * sequence.frames.size() / 5];
      const auto truth = std::min_element(
          sequence.groundtruth.begin(), sequence.groundtruth.end(), [&](const auto& a, const auto& b) {
            return std::abs(a.t - record.t_depth) < std::abs(b.t - record.t_depth);
          });
      const runtime::RgbdFrame frame = runtime::decode_frame(record, k, config);
      depth.push_back(frame.depth);
      bgr.push_back(frame.bgr);
      T_w_c.push_back(truth->T_w_c);
    }
  }
  void make_up() {
    for (int k = 0; k < 5; ++k) {
      cv::Mat z(480, 640, CV_32FC1), colours(480, 640, CV_8UC3, cv::Scalar(40, 90, 160));
      for (int v = 0; v < 480; ++v) {
        for (int u = 0; u < 640; ++u)
          z.at<float>(v, u) = 2.2F + 0.3F * std::sin(0.01F * static_cast<float>(u + 40 * k)) +
                              0.2F * std::cos(0.015F * static_cast<float>(v));
      }
      depth.push_back(z);
      bgr.push_back(colours);
      T_w_c.push_back(
          SE3d(SO3d::exp(Eigen::Vector3d(0, 0.05 * k, 0)), Eigen::Vector3d(0.02 * k, 0.01, 0.013)));
    }
  }
};

const Keyframes& keyframes() {
  static const Keyframes all;
  return all;
}

template <class Map>
void insert(Map& map, const runtime::MapScanner& scanner, ScanVoxels& voxels) {
  const Keyframes& in = keyframes();
  const ImageView<const std::uint8_t> nothing_moves(nullptr, 0, 0, 0);
  for (std::size_t k = 0; k < in.depth.size(); ++k) {
    const auto scan = scanner.pack(interop::view<float>(in.depth[k]), nothing_moves, in.labels,
                                   runtime::BgrView{in.bgr[k]});
    scanner.gather(scan, in.T_w_c[k], voxels);
    map.integrate(voxels);
  }
}

const std::vector<test::WorldScan>& clouds() {
  static const std::vector<test::WorldScan> all = [] {
    const Keyframes& in = keyframes();
    std::vector<test::WorldScan> out;
    for (std::size_t k = 0; k < in.depth.size(); ++k) {
      test::WorldScan scan;
      scan.origin = in.T_w_c[k].translation().cast<float>();
      for (int v = 1; v < 480; v += 2) {
        for (int u = 1; u < 640; u += 2) {
          const float z = in.depth[k].at<float>(v, u);
          if (!is_valid_depth(z)) continue;
          const auto p = in.camera.unproject(Eigen::Vector2d(u, v), double(z));
          if (!p) continue;
          const auto& bgr = in.bgr[k].at<cv::Vec3b>(v, u);
          const Eigen::Vector3d world = in.T_w_c[k] * *p;
          scan.points.push_back({world.cast<float>(), 0, {bgr[2], bgr[1], bgr[0]}});
        }
      }
      out.push_back(std::move(scan));
    }
    return out;
  }();
  return all;
}

/// Occupied voxels; what is pruned counts as what it stands for.
template <class Tree>
double occupied(const Tree& tree) {
  double voxels = 0;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (tree.isNodeOccupied(*it)) voxels += std::pow(8.0, int(tree.getTreeDepth() - it.getDepth()));
  }
  return voxels;
}

template <class Map, class Make>
void ours(benchmark::State& state, const Make& make) {
  const runtime::MapScanner scanner(keyframes().camera, 640, 480);
  ScanVoxels voxels{VoxelGrid(kEdge)};
  {  // edges and grazing surfaces are no map of ours, so that it has some voxels less
    interop::SemanticOcTree tree(kEdge);
    insert(tree, scanner, voxels);
    octomap::ColorOcTree rival(kEdge);
    baselines::ColorTreeScans(clouds(), kMaxRange).insert(rival, true, true);
    const double share = occupied(tree) / occupied(rival);
    state.counters["share_of_rivals_voxels"] = share;
    if (!(share > 0.6 && share < 1.05)) {
      state.SkipWithError("another map than OctoMap's");
      return;
    }
  }
  for (auto _ : state) {
    Map map = make();
    insert(map, scanner, voxels);
    benchmark::DoNotOptimize(&map);
  }
}

void color_octree(benchmark::State& state) {
  const baselines::ColorTreeScans scans(clouds(), kMaxRange);
  for (auto _ : state) {
    octomap::ColorOcTree tree(kEdge);
    scans.insert(tree, true, true);
    benchmark::DoNotOptimize(tree.size());
  }
}

const bool registered = [] {
  constexpr const char* kWhat = "insertion/5_labelled_keyframes_5cm";
  constexpr auto kUnit = benchmark::kMillisecond;
  bench::add(
      kWhat, "float", "dynslam",
      [](benchmark::State& s) {
        ours<interop::SemanticOcTree>(s, [] { return interop::SemanticOcTree(kEdge); });
      },
      kUnit);
  bench::add(
      kWhat, "float", "dynslam_block_map",
      [](benchmark::State& s) {
        ours<VoxelBlockMap<float>>(s, [] { return VoxelBlockMap<float>(VoxelGrid(kEdge)); });
      },
      kUnit);
  bench::add(kWhat, "float", "octomap_lazy", color_octree, kUnit);
  return true;
}();

}  // namespace
#endif

BENCHMARK_MAIN();
