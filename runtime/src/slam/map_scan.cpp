// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/map_scan.hpp"

#include "io/binary_file.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace dynslam::runtime {

namespace {

constexpr float kCarveSigmas = 2.0F;  // a ray stops so many standard deviations before the surface

}  // namespace

void MapScan::write(BinaryWriter& out) const {
  out.put(depth_);
  out.put(code_);
  out.put(rgb_);
}

MapScan MapScan::read(BinaryReader& in, std::size_t samples) {
  MapScan scan;
  in.get(scan.depth_);
  in.get(scan.code_);
  in.get(scan.rgb_);
  in.require(scan.depth_.size() == samples && scan.code_.size() == samples, "holds scans of another camera");
  std::size_t surface = 0;
  for (const std::uint8_t code : scan.code_) {
    const int use = code >> 6;
    in.require(use <= static_cast<int>(Use::surface), "holds a scan that cannot be");
    surface += use == static_cast<int>(Use::surface) ? 1 : 0;
  }
  in.require(scan.rgb_.size() == 3 * surface, "holds a scan that cannot be");
  return scan;
}

MapScanner::MapScanner(const PinholeBrownConrady<double>& camera, int width, int height,
                       const MapScanOptions& options)
    : options_(options), width_(width), height_(height) {
  // On a surface seen at angle a depth changes by tan(a) times what one pixel spans, z / f.
  const double focal = 0.5 * (camera.pinhole().fx() + camera.pinhole().fy());
  max_slope_ = static_cast<float>(std::tan(options.max_incidence * std::numbers::pi / 180) / focal);
  for (int v = options_.pixel_stride / 2; v < height; v += options_.pixel_stride) {
    for (int u = options_.pixel_stride / 2; u < width; u += options_.pixel_stride) {
      const auto ideal = camera.undistort_pixel(Eigen::Vector2d(u, v));
      if (!ideal) continue;
      rays_.push_back(camera.pinhole().ray(*ideal).cast<float>());
      pixels_.push_back(v * width + u);
    }
  }
}

MapScan MapScanner::pack(const cv::Mat& depth, const cv::Mat& dynamic_mask, const cv::Mat& labels,
                         const cv::Mat& bgr) const {
  MapScan scan;
  scan.depth_.resize(pixels_.size());
  scan.code_.resize(pixels_.size());
  scan.rgb_.reserve(3 * pixels_.size());
  const auto max_range = static_cast<float>(options_.max_range);
  const int reach = options_.edge_reach;
  const auto smooth = [&](int u, int v, float z) {
    const float limit = static_cast<float>(reach) * max_slope_ * z + 3.0F * options_.noise.sigma(z);
    const auto near = [&](int du, int dv) {
      const int x = u + du, y = v + dv;
      if (x < 0 || y < 0 || x >= width_ || y >= height_) return true;
      const float other = depth.ptr<float>(y)[x];
      return !is_valid_depth(other) || std::abs(other - z) <= limit;
    };
    return near(-reach, 0) && near(reach, 0) && near(0, -reach) && near(0, reach);
  };
  for (std::size_t k = 0; k < pixels_.size(); ++k) {
    const int v = pixels_[k] / width_, u = pixels_[k] % width_;
    const float z = depth.ptr<float>(v)[u];
    if (!is_valid_depth(z) || z * MapScan::kUnitsPerMetre > 65535.0F || !smooth(u, v, z)) continue;
    const std::uint8_t label = labels.empty() ? 0 : labels.ptr<std::uint8_t>(v)[u];
    const bool mover = (!dynamic_mask.empty() && dynamic_mask.ptr<std::uint8_t>(v)[u] != 0) ||
                       label == static_cast<std::uint8_t>(Label::person);
    const bool surface = !mover && z <= max_range;
    scan.depth_[k] = static_cast<std::uint16_t>(z * MapScan::kUnitsPerMetre + 0.5F);
    const auto use = static_cast<unsigned>(surface ? MapScan::Use::surface : MapScan::Use::free);
    scan.code_[k] = static_cast<std::uint8_t>(use << 6 | (label & 63U));
    if (!surface) continue;
    const auto& colour = bgr.ptr<cv::Vec3b>(v)[u];
    scan.rgb_.insert(scan.rgb_.end(), {colour[2], colour[1], colour[0]});
  }
  scan.rgb_.shrink_to_fit();
  return scan;
}

void MapScanner::gather(const MapScan& scan, const SE3<double>& T_w_c, ScanVoxels& out) const {
  out.clear();
  const Eigen::Matrix3f R = T_w_c.rotation_matrix().cast<float>();
  const Eigen::Vector3f t = T_w_c.translation().cast<float>();
  const auto edge = static_cast<float>(out.grid().resolution());
  const auto max_range = static_cast<float>(options_.max_range);
  std::size_t colour = 0;
  for (std::size_t k = 0; k < scan.depth_.size(); ++k) {
    const auto use = static_cast<MapScan::Use>(scan.code_[k] >> 6);
    if (use == MapScan::Use::nothing) continue;
    const float z = static_cast<float>(scan.depth_[k]) / MapScan::kUnitsPerMetre;
    const float sigma = options_.noise.sigma(z);
    const Eigen::Vector3f ray = R * rays_[k];
    float clear = z - kCarveSigmas * sigma;
    if (use == MapScan::Use::surface) {
      const std::array<std::uint8_t, 3> rgb{scan.rgb_[colour], scan.rgb_[colour + 1], scan.rgb_[colour + 2]};
      colour += 3;
      // A surface that noise spreads over several voxels is seen in each of them less often.
      const float weight = std::min(1.0F, edge / (4.0F * sigma));
      const Eigen::Vector3f p = t + ray * z;
      if (!out.add_end(p, scan.code_[k] & 63U, rgb, weight)) continue;  // one ray per voxel clears the way
    } else {
      clear =
          std::min(clear - edge, max_range);  // a mover's outline is not exact: a voxel's distance from it
    }
    if (clear > 0.0F) {
      const Eigen::Vector3f end = t + ray * clear;
      if (use == MapScan::Use::surface) {
        out.carve(t, end);
      } else {
        out.carve_once(t, end);
      }
    }
  }
  out.finish();
}

}  // namespace dynslam::runtime
