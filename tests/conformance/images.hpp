// SPDX-License-Identifier: BSD-3-Clause
// One run of everything that reads or writes images, over one kind of image.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cameras.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/standing.hpp"
#include "dynslam/features/corners.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/features/feature_placer.hpp"
#include "dynslam/features/masked_features.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/depth_bounds.hpp"
#include "dynslam/image/eigen_view.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/image/normals.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/image/sample.hpp"
#include "dynslam/image/strided_view.hpp"
#include "dynslam/segment/connected_components.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/detail/depth_lanes.hpp"
#include "dynslam/segment/detail/growing_field.hpp"
#include "dynslam/segment/growing_criteria.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/mask_completion.hpp"
#include "dynslam/segment/mask_growing.hpp"
#include "dynslam/segment/mask_upsampling.hpp"
#include "dynslam/segment/pixel_runs.hpp"
#include "dynslam/segment/region_growing.hpp"
#include "dynslam/segment/support_planes.hpp"
#include "dynslam/semantic/carried_labels.hpp"
#include "dynslam/semantic/map_scan.hpp"
#include "image_kinds.hpp"
#include "random.hpp"
#include "record.hpp"

namespace dynslam::test {

/// An image in two numbers: its mean, and one that moving a pixel changes. Pixels that are no number count as
/// -1.
template <ImageLike I>
void put_image(Record<double>& out, const std::string& name, const I& image) {
  double mean = 0, placed = 0, weight = 0;
  for (int v = 0; v < image.height(); ++v) {
    for (int u = 0; u < image.width(); ++u) {
      const auto x = static_cast<double>(image(u, v));
      const double number = std::isnan(x) ? -1 : x, w = 1 + (7 * u + 13 * v) % 31;
      mean += number;
      placed += w * number;
      weight += w;
    }
  }
  out.put(name + ".mean", mean / std::max(1, image.width() * image.height()));
  out.put(name + ".placed", placed / std::max(1.0, weight));
}

namespace conformance {

/// A floor and a box before a wall, with holes, and masks over it.
template <std::floating_point S>
struct ImageSet {
  Image<S> depth{kWidth, kHeight, S(0)};
  Image<std::uint8_t> gray{kWidth, kHeight, 0}, mask{kWidth, kHeight, 0}, instances{kWidth, kHeight, 0};
  Image<std::uint16_t> raw{kWidth, kHeight, 0};
  Image<std::array<std::uint8_t, 3>> colours{kWidth, kHeight, {10, 20, 30}};

  ImageSet() {
    Rng rng("conformance images");
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const bool box = u >= 40 && u < 80 && v >= 30 && v < 80;
        raw(u, v) = static_cast<std::uint16_t>(rng.chance(0.02) ? 0 : box ? 8000 : 14000 - 20 * v);
        depth(u, v) = raw(u, v) == 0 ? std::numeric_limits<S>::quiet_NaN() : S(raw(u, v)) / S(5000);
        gray(u, v) = static_cast<std::uint8_t>(rng.integer(0, 255));
        mask(u, v) = box && rng.chance(0.9) ? 255 : 0;
        instances(u, v) = box ? 2 : 0;
      }
    }
  }
};

template <class Kind, std::floating_point S>
void masks_of(const ImageSet<S>& set, Record<double>& out) {
  const Image<std::uint8_t> zero(kWidth, kHeight, 0);
  MaskWorkspace workspace;
  auto in = Kind::make(set.mask);
  auto result = Kind::make(zero);
  dilate(Kind::in(in), Kind::out(result), 2, workspace);
  put_image(out, "dilate", Kind::in(result));
  erode(Kind::in(in), Kind::out(result), 1);
  put_image(out, "erode", Kind::in(result));
  remove_small(Kind::out(result), 4, workspace);
  put_image(out, "remove_small", Kind::in(result));
  fill_holes(Kind::out(in), 6);
  put_image(out, "fill_holes", Kind::in(in));
  auto labels = Kind::make(Image<int>(kWidth, kHeight, 0));
  std::vector<int> counts;
  out.put("connected_components",
          connected_components(Kind::in(result), Connectivity::four, Kind::out(labels), counts));
  put_image(out, "labels", Kind::in(labels));
  out.put("same_size", same_size(Kind::in(in), Kind::in(result)));
}

template <std::floating_point S>
void supports_of(const ImageSet<S>& set, Record<double>& out) {
  Image<float> depth(kWidth, kHeight, 0.0F);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) depth(u, v) = static_cast<float>(set.depth(u, v));
  }
  Image<int> plane;
  SupportPlaneWorkspace workspace;
  SupportPlaneOptions options;
  options.area = 0.3;
  split_supports(conformance_camera<Pinhole<float>>(), depth, RelativeStep<float>{}, options, plane, workspace);
  out.put("split_supports", plane(60, 50));
}

template <class Kind, std::floating_point S>
void growing_of(const ImageSet<S>& set, Record<double>& out) {
  const Image<std::uint8_t> zero(kWidth, kHeight, 0);
  const auto depth = Kind::make(set.depth);
  const auto instances = Kind::make(set.instances);
  auto barrier = Kind::make(zero), grown = Kind::make(zero), seed = Kind::make(zero);
  for (int v = 0; v < kHeight; ++v) Kind::out(barrier)(60, v) = 1;
  const auto camera = conformance_camera<Pinhole<S>>();
  Image<Eigen::Matrix<S, 3, 1>> normals(kWidth, kHeight);
  surface_normals(camera, Kind::in(depth), NormalOptions<S>{}, normals);
  out.put("surface_normals", normals(20, 20).template cast<double>());
  const std::vector<PixelIndex> seeds{{50, 50}, {45, 40}};
  const auto& labels = Kind::in(instances);
  const RelativeStep<S> step;
  const SameLabelStep same(labels, step);
  const SmoothSurfaceStep smooth(normals, S(0.5), FixedStep<S>{});
  RegionGrowingWorkspace workspace;
  const auto grow = [&](const char* name, const auto& criterion) {
    auto r = grow_regions(Kind::in(depth), Kind::in(barrier), std::span<const PixelIndex>(seeds), criterion,
                          {}, Kind::out(grown), workspace);
    out.put(std::string(name) + ".pixels", static_cast<double>(r.pixels));
    r = grow_regions(Kind::in(depth), std::span<const PixelIndex>(seeds), criterion, {}, Kind::out(grown));
    put_image(out, name, Kind::in(grown));
  };
  grow("relative", step);
  grow("same_label", same);
  grow("smooth", smooth);
  for (int u = 46; u < 56; ++u) Kind::out(seed)(u, 45) = Kind::out(seed)(u, 46) = 1;
  MaskGrowingWorkspace growing;
  const auto result = grow_mask(Kind::in(depth), Kind::out(seed), Kind::out(barrier),
                                Kind::out(grown), MaskGrowingOptions{}, growing);
  out.put("beside_nearer", beside_nearer(Kind::in(depth), 30, 30, 4, FreeSpaceMargins<S>{}) ? 1 : 0);
  out.put("grow_mask.seeds", result.seeds);
  put_image(out, "grow_mask", Kind::in(grown));
  UnmeasuredWorkspace unmeasured;
  complete_unmeasured(labels, Kind::in(depth), Kind::out(grown), {}, unmeasured);
  put_image(out, "complete_mask", Kind::in(grown));
}

template <class Kind, std::floating_point S>
void cells_of(const ImageSet<S>& set, Record<double>& out) {
  const Image<std::uint8_t> zero(kWidth, kHeight, 0);
  const auto camera = conformance_camera<Pinhole<S>>();
  const auto depth = Kind::make(set.depth);
  const auto mask = Kind::make(set.mask), instances = Kind::make(set.instances);
  const DepthGrid grid(camera, kWidth, kHeight, DepthGridOptions{40});
  Image<float> reduced;
  Image<std::uint8_t> smooth, zone;
  grid.reduce(Kind::in(depth), reduced, smooth);
  put_image(out, "reduce", reduced);
  put_image(out, "reduce.smooth", smooth);
  Image<std::uint8_t> cells(grid.width(), grid.height(), 0);
  for (int j = 8; j < 20; ++j) {
    for (int i = 10; i < 20; ++i) cells(i, j) = 255;
  }
  const auto cell_mask = Kind::make(cells);
  const auto cell_depth = Kind::make(reduced);
  auto full = Kind::make(zero);
  upsample_mask(Kind::in(cell_mask), Kind::in(cell_depth), Kind::in(depth), grid, Kind::out(full), zone);
  put_image(out, "upsample_mask", Kind::in(full));
  const auto verified = [](int u, int) { return u > 45; };
  auto standing = Kind::make(zero);
  mark_standing(Kind::in(mask), verified, 4, Kind::out(standing));
  put_image(out, "mark_standing", Kind::in(standing));
  std::vector<StandingCount> counts;
  mark_standing_objects(Kind::in(instances), Kind::in(depth), Kind::in(mask), Kind::out(standing), counts);
  put_image(out, "mark_standing_objects", Kind::in(standing));
  auto carried = Kind::make(zero);
  // Seen from where it is, so that no pixel lies between two.
  carry_labels(camera, Kind::in(depth), Kind::in(instances), Kind::in(depth), SE3<S>(), Kind::out(carried));
  put_image(out, "carry_labels", Kind::in(carried));
  DepthBounds<S> bounds;
  bounds.compute(Kind::in(depth));
  put_image(out, "bounds.nearest", bounds.nearest);
  put_image(out, "bounds.farthest", bounds.farthest);
}

template <class Kind, std::floating_point S>
void features_of(const ImageSet<S>& set, Record<double>& out) {
  const auto camera = conformance_camera<PinholeBrownConrady<S>>();
  const auto depth = Kind::make(set.depth);
  const auto gray = Kind::make(set.gray), mask = Kind::make(set.mask);
  const auto raw = Kind::make(set.raw);
  auto metres = Kind::make(set.depth);
  depth_to_metres(Kind::in(raw), S(5000), Kind::out(metres));
  put_image(out, "depth_to_metres", Kind::in(metres));
  const auto sample = bilinear_with_gradient<S>(Kind::in(gray), S(30.25), S(40.5));
  out.put("sample", static_cast<double>(sample->value));
  out.put("sample.gradient", sample->gradient.template cast<double>());
  out.put("bilinear", static_cast<double>(*bilinear<S>(Kind::in(gray), S(30.25), S(40.5))));
  HalvingPyramid<std::uint8_t> bytes;
  HalvingPyramid<float> floats;
  bytes.build(Kind::in(gray), 3);
  floats.build(Kind::in(gray), 3);
  put_image(out, "pyramid.bytes", bytes.image(2));
  put_image(out, "pyramid.floats", floats.image(2));
  out.put("to_level", to_level<S>(bytes, Eigen::Matrix<S, 2, 1>(S(33), S(21)), 2).template cast<double>());
  out.put("to_base", to_base<S>(bytes, Eigen::Matrix<S, 2, 1>(S(33), S(21)), 2).template cast<double>());
  CornerWorkspace workspace;
  std::vector<Eigen::Vector2i> corners;
  find_corners(bytes.image(0), 400, CornerOptions{}, workspace, corners);
  out.put("corners", static_cast<double>(corners.size()));
  FeaturePlacer<PinholeBrownConrady<S>> placer(camera, kWidth, kHeight);
  std::vector<Feature> features(3);
  for (std::size_t i = 0; i < features.size(); ++i) {
    placer.place(features[i], Eigen::Matrix<S, 2, 1>(S(42.3) + S(30) * S(i), S(50.2)), Kind::in(depth));
    out.put("place", placer.point(features[i]).template cast<double>());
  }
  Eigen::Matrix<S, 6, 1> while_read;
  while_read << S(0.01), S(-0.01), S(0.005), S(0.01), S(0.02), S(-0.01);
  placer.set_rolling_shutter(RollingShutter<S>(while_read, kHeight));
  Feature middle;
  placer.place(middle, Eigen::Matrix<S, 2, 1>(S(42.3), S(20.2)), Kind::in(depth));
  out.put("place.rolling_shutter", placer.point(middle).template cast<double>());
  std::vector<std::uint8_t> flags(features.size(), 0);
  flag_masked(Kind::in(mask), std::span<const Feature>(features), std::span<std::uint8_t>(flags));
  for (const auto f : flags) out.put("flag_masked", f);
  const MapScanner<S> scanner(camera, kWidth, kHeight);
  const auto labels = Kind::make(set.instances);
  const auto scan = scanner.pack(Kind::in(depth), Kind::in(mask), Kind::in(labels), set.colours);
  out.put("pack.consistent", scan.consistent());
  double sum = 0;
  for (std::size_t k = 0; k < scan.depth.size(); ++k) sum += scan.depth[k] + 10.0 * scan.label(k);
  out.put("pack", sum / static_cast<double>(scan.depth.size()));
}

}  // namespace conformance

/// Results of all functions of images, which are the same for every kind of image.
template <class Kind, std::floating_point S>
[[nodiscard]] Record<double> image_results() {
  static const conformance::ImageSet<S> set;
  Record<double> out;
  conformance::masks_of<Kind>(set, out);
  conformance::supports_of<S>(set, out);
  conformance::growing_of<Kind>(set, out);
  conformance::cells_of<Kind>(set, out);
  conformance::features_of<Kind>(set, out);
  return out;
}

}  // namespace dynslam::test
