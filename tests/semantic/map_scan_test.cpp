// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/map_scan.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/semantic/scan_voxels.hpp"
#include "equidistant_camera.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

using Rgb = std::array<std::uint8_t, 3>;

/// A wall at 2 m with a block of another label at 1 m in its middle.
struct Scene {
  Image<float> depth{160, 120, 2.0F};
  Image<std::uint8_t> mask{160, 120, 0};
  Image<std::uint16_t> labels{160, 120, 0};
  Image<Rgb> colours{160, 120, Rgb{200, 100, 10}};
  explicit Scene(int label = 0) {
    for (int v = 40; v < 80; ++v) {
      for (int u = 60; u < 100; ++u) {
        depth(u, v) = 1.0F;
        labels(u, v) = static_cast<std::uint16_t>(label);
        colours(u, v) = Rgb{1, 2, 3};
      }
    }
  }
};

template <class Scan>
int surfaces(const Scan& scan) {
  int n = 0;
  for (std::size_t k = 0; k < scan.code.size(); ++k) n += scan.use(k) == Scan::Use::surface ? 1 : 0;
  return n;
}

/// What a map would be told.
template <class S>
struct Recorder {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  struct Grid {
    [[nodiscard]] double resolution() const { return 0.05; }
  };
  std::vector<Vector3> ends, carved;
  std::vector<int> labels;
  std::vector<float> weights;
  bool finished = false;
  [[nodiscard]] Grid grid() const { return {}; }
  void clear() { *this = Recorder(); }
  bool add_end(const Vector3& p, int label, const Rgb& /*rgb*/, float weight) {
    ends.push_back(p);
    labels.push_back(label);
    weights.push_back(weight);
    return true;
  }
  void carve(const Vector3& /*from*/, const Vector3& to) { carved.push_back(to); }
  void carve_once(const Vector3& /*from*/, const Vector3& to) { carved.push_back(to); }
  void finish() { finished = true; }
};

}  // namespace

TEST_CASE_TEMPLATE("a scan keeps depth, label and colour of the surfaces, and gives them back as points", S,
                   float, double) {
  const Pinhole<S> camera(S(100), S(100), S(80), S(60));
  MapScanOptions<S> options;
  options.pixel_stride = 1;
  const MapScanner<S> scanner(camera, 160, 120, options);
  const Scene scene(7);
  const MapScan<> scan = scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours);
  CHECK(scanner.samples() == 160 * 120);
  CHECK(scan.consistent());
  CHECK(scan.bytes() < 6 * 160 * 120 + 1);
  const SE3<S> T_w_c(SO3<S>::exp(Eigen::Matrix<S, 3, 1>(0, S(0.3), 0)), Eigen::Matrix<S, 3, 1>(1, 2, 3));
  Recorder<S> voxels;
  scanner.gather(scan, T_w_c, voxels);
  CHECK(voxels.finished);
  // All but the pixels about the block's outline, whose neighbours are a metre off.
  CHECK(static_cast<int>(voxels.ends.size()) == surfaces(scan));
  CHECK(voxels.ends.size() == 160 * 120 - (44 * 40 - 36 * 36 + 44 * 40 - 40 * 40));
  int blocks = 0;
  for (std::size_t i = 0; i < voxels.ends.size(); ++i) {
    const Eigen::Matrix<S, 3, 1> p = T_w_c.inverse() * voxels.ends[i];
    const bool block = voxels.labels[i] == 7;
    blocks += block ? 1 : 0;
    CHECK(std::abs(p.z() - (block ? S(1) : S(2))) < S(2e-4));
    CHECK((voxels.ends[i] - voxels.carved[i]).norm() > S(0));
  }
  CHECK(blocks == 36 * 36);
}

TEST_CASE_TEMPLATE("moving objects are no surface, the way to them is free", S, float, double) {
  const MapScanner<S> scanner(Pinhole<S>(S(100), S(100), S(80), S(60)), 160, 120);
  const Image<std::uint8_t> none;
  const Scene person(1);
  const auto seen = scanner.pack(person.depth, none, person.labels, person.colours);
  Scene masked(0);
  for (int v = 40; v < 80; ++v) {
    for (int u = 60; u < 100; ++u) masked.mask(u, v) = 255;
  }
  const auto covered = scanner.pack(masked.depth, masked.mask, none, masked.colours);
  CHECK(surfaces(seen) == surfaces(covered));
  for (const auto* scan : {&seen, &covered}) {
    Recorder<S> voxels;
    scanner.gather(*scan, SE3<S>(), voxels);
    for (const auto& p : voxels.ends) CHECK(p.z() > S(1.9));
    CHECK(voxels.carved.size() > voxels.ends.size());
    for (const auto& p : voxels.carved) CHECK((p.z() < S(1) - S(0.04) || p.z() > S(1.5)));
  }
}

TEST_CASE("labels above 64 take a byte more; those that a scan cannot tell apart are none") {
  const MapScanner<> scanner(Pinhole<float>(100, 100, 80, 60), 160, 120);
  const Scene scene(79);
  const auto wide = scanner.pack<80>(scene.depth, scene.mask, scene.labels, scene.colours);
  CHECK(sizeof(wide.code[0]) == 2);
  const auto narrow = scanner.pack<20>(scene.depth, scene.mask, scene.labels, scene.colours);
  CHECK(sizeof(narrow.code[0]) == 1);
  const auto most = [](const auto& scan) {
    int highest = 0;
    for (std::size_t k = 0; k < scan.code.size(); ++k) highest = std::max(highest, scan.label(k));
    return highest;
  };
  CHECK(most(wide) == 79);
  CHECK(most(narrow) == 0);
  CHECK(wide.consistent());
  CHECK(surfaces(wide) == surfaces(narrow));
}

TEST_CASE_TEMPLATE("pixels for which the lens has no inverse are no part of a scan", S, float, double) {
  const Pinhole<S> pinhole(S(100), S(100), S(80), S(60));
  // Folds at r = 0.82, where 0.54 is the farthest that anything is seen: pixels beyond have no ray.
  const PinholeBrownConrady<S> folded(pinhole, BrownConrady<S>(S(-0.5), S(0), S(0), S(0), S(0)));
  const MapScanner<S> scanner(folded, 160, 120), ideal(pinhole, 160, 120);
  CHECK(ideal.samples() == 80 * 60);
  CHECK(scanner.samples() < ideal.samples());
  CHECK(scanner.samples() > 2000);
  const Scene scene;
  const auto scan = scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours);
  Recorder<S> voxels;
  scanner.gather(scan, SE3<S>(), voxels);
  for (const auto& p : voxels.ends) CHECK(p.template head<2>().norm() < S(0.83) * p.z());
}

TEST_CASE_TEMPLATE("a fisheye that the library does not know fills the same wall", S, float, double) {
  // 160 degrees across: a pinhole of the same focal length would see 77.
  const test::EquidistantCamera<S> fisheye(S(57.3), S(79.5), S(59.5));
  const MapScanner<S> scanner(fisheye, 160, 120);
  const Scene scene;
  const auto scan = scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours);
  Recorder<S> voxels;
  scanner.gather(scan, SE3<S>(), voxels);
  CHECK(voxels.ends.size() > 3000);
  S widest = S(0);
  for (const auto& p : voxels.ends) {
    CHECK((std::abs(p.z() - S(2)) < S(1e-3) || std::abs(p.z() - S(1)) < S(1e-3)));
    const auto x = fisheye.project(p);
    REQUIRE(x);
    CHECK(std::abs(x->x() - std::round(x->x())) < S(1e-2));  // on the ray of its pixel
    widest = std::max(widest, std::abs(p.x()) / p.z());
  }
  CHECK(widest > S(4));
}

TEST_CASE_TEMPLATE("what is farther than the range clears the way up to it, whatever the depth", S, float,
                   double) {
  const Pinhole<S> camera(S(100), S(100), S(80), S(60));
  // Depth that is as good far away as near: the range alone limits what is mapped.
  MapScanOptions<S> options;
  options.noise = DepthNoise<S>::time_of_flight(S(0.005), S(0));
  const SE3<S> T_w_c(SO3<S>(), Eigen::Matrix<S, 3, 1>(S(0.5), S(-0.5), S(1)));
  for (const double range : {4.0, 12.0, 30.0, 0.0}) {
    options.max_range = range;
    const MapScanner<S> scanner(camera, 160, 120, options);
    for (const double z : {0.7, 3.0, 13.0, 13.2, 25.0, 100.0, 900.0}) {
      CAPTURE(range);
      CAPTURE(z);
      Scene scene;
      for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u) scene.depth(u, v) = static_cast<float>(z);
      const auto scan = scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours);
      Recorder<S> voxels;
      scanner.gather(scan, T_w_c, voxels);
      REQUIRE(voxels.carved.size() == scanner.samples());
      const bool mapped = range == 0 || z <= range;
      CHECK(voxels.ends.size() == (mapped ? scanner.samples() : 0));
      // As far as the surface is certain to be, or to the range; to a voxel before what is not mapped.
      const double clear = mapped ? z - 0.01 : std::min(z - 0.01 - 0.05, range);
      for (const auto& p : voxels.ends) CHECK(std::abs(double(p.z()) - 1 - z) < 3e-4 * z);
      for (const auto& p : voxels.carved) CHECK(std::abs(double(p.z()) - 1 - clear) < 3e-4 * z);
    }
  }
}

TEST_CASE_TEMPLATE("the neighbours' depth takes noise off a plane and leaves its edges out", S, float,
                   double) {
  // A floor that rises from 1 m below the camera, seen with the sensor's noise.
  const Pinhole<S> camera(S(100), S(100), S(80), S(60));
  MapScanOptions<S> options;
  options.pixel_stride = 1;
  const MapScanner<S> scanner(camera, 160, 120, options);
  test::Rng rng("noise of a plane");
  Scene scene;
  const Eigen::Vector3d normal(0.3, 0.5, -1);  // . p = -2
  double noise = 0;
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      const double z = -2 / normal.dot(Eigen::Vector3d((u - 80) / 100.0, (v - 60) / 100.0, 1)),
                   off = double(options.noise.sigma(static_cast<S>(z))) * rng.normal();
      scene.depth(u, v) =
          u == 40 && v == 40 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(z + off);
      noise += off * off;
    }
  }
  Recorder<S> voxels;
  scanner.gather(scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours), SE3<S>(), voxels);
  REQUIRE(voxels.ends.size() > 0.95 * 160 * 120);
  double left = 0, bias = 0;
  for (const auto& p : voxels.ends) {
    const Eigen::Vector3d q = p.template cast<double>();
    const double off = (normal.dot(q) + 2) / normal.dot(q / q.z());  // in depth
    left += off * off;
    bias += off;
  }
  const auto count = static_cast<double>(voxels.ends.size());
  CHECK(std::sqrt(left / count) < 0.5 * std::sqrt(noise / (160 * 120)));  // 1 / sqrt(5) within the image
  CHECK(std::abs(bias / count) < 0.05 * std::sqrt(noise / (160 * 120)));
}

TEST_CASE_TEMPLATE("rays out of the grid clear the way up to its border", S, float, double) {
  const Pinhole<S> camera(S(100), S(100), S(80), S(60));
  MapScanOptions<S> options;
  options.noise = DepthNoise<S>::time_of_flight(S(0.005), S(0));
  const MapScanner<S> scanner(camera, 160, 120, options);
  Scene scene;
  for (int v = 0; v < 120; ++v)
    for (int u = 0; u < 160; ++u) scene.depth(u, v) = 40.0F;
  const double edge = 0.05, border = 32767.5 * edge;
  const SE3<S> T_w_c(SO3<S>(), Eigen::Matrix<S, 3, 1>(S(0.5), S(-0.5), S(border - 20)));
  Recorder<S> voxels;
  scanner.gather(scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours), T_w_c, voxels);
  CHECK(voxels.ends.empty());
  REQUIRE(voxels.carved.size() == scanner.samples());
  for (const auto& p : voxels.carved) CHECK(std::abs(double(p.z()) - border) < 1e-3);
  ScanVoxels scan{VoxelGrid(edge)};
  scanner.gather(scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours), T_w_c, scan);
  CHECK(scan.hits() == 0);
  CHECK(scan.misses() > 20 / edge);
}

TEST_CASE_TEMPLATE("without a given range the noise sets one, by the edge of the voxels", S, float, double) {
  MapScanOptions<S> options;
  for (const double edge : {0.02, 0.05, 0.2}) {
    const double range = options.range(edge);
    CHECK(double(options.noise.sigma(static_cast<S>(range))) == doctest::Approx(options.range_edges * edge));
  }
  options.max_range = 2.5;
  CHECK(options.range(0.05) == 2.5);
  options.max_range = 0;
  CHECK(options.range(0.0005) == 0);  // no depth is as good as such voxels
  using Noise = DepthNoise<S>;
  CHECK(double(Noise::time_of_flight(S(0.01), S(0.01)).range(S(0.05))) == doctest::Approx(4));
  CHECK(Noise::time_of_flight(S(0.01), S(0)).range(S(0.05)) == std::numeric_limits<S>::infinity());
  CHECK(Noise::structured_light(S(0.01), S(0.002)).range(S(0.01)) == S(0));
  CHECK(double(Noise{S(0), S(1e-30), S(1)}.range(S(3))) == doctest::Approx(3));  // nothing cancels

  // A wall at 2 m is mapped with voxels of 5 cm and is beyond the range with those of 5 mm.
  const MapScanner<S> scanner(Pinhole<S>(S(100), S(100), S(80), S(60)), 160, 120);
  Scene scene;
  scene.depth.fill(2.0F);
  const auto scan = scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours);
  ScanVoxels coarse{VoxelGrid(0.05)}, fine{VoxelGrid(0.005)};
  scanner.gather(scan, SE3<S>(), coarse);
  scanner.gather(scan, SE3<S>(), fine);
  CHECK(coarse.hits() > 500);
  CHECK(fine.hits() == 0);
  CHECK(fine.misses() > 10000);
}

TEST_CASE("a damaged scan is recognised") {
  const MapScanner<> scanner(Pinhole<float>(100, 100, 80, 60), 160, 120);
  const Scene scene;
  const MapScan<> good = scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours);
  MapScan<> bad = good;
  bad.code[0] = 0xFF;
  CHECK_FALSE(bad.consistent());
  bad = good;
  bad.rgb.pop_back();
  CHECK_FALSE(bad.consistent());
  bad = good;
  bad.depth.pop_back();
  CHECK_FALSE(bad.consistent());
}

TEST_CASE("a scan's voxels are those of its points") {
  const MapScanner<> scanner(Pinhole<float>(100, 100, 80, 60), 160, 120);
  const Scene scene;
  ScanVoxels voxels{VoxelGrid(0.05)};
  scanner.gather(scanner.pack(scene.depth, scene.mask, scene.labels, scene.colours), SE3<double>(), voxels);
  CHECK(voxels.hits() > 1000);
  CHECK(voxels.misses() > voxels.hits());
}
