// SPDX-License-Identifier: BSD-3-Clause
// Scans to compare maps on: recorded ones where the data are there, a made-up room otherwise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/semantic/scan_voxels.hpp"

namespace dynslam::test {

struct WorldScan {
  Eigen::Vector3f origin;
  std::vector<ScanPoint> points;
};

/// Folder of a TUM sequence below DYNSLAM_DATA; nullopt where it is absent.
inline std::optional<std::filesystem::path> recorded_sequence(const std::string& name) {
  const char* data = std::getenv("DYNSLAM_DATA");
  if (data == nullptr) return std::nullopt;
  const auto path = std::filesystem::path(data) / "tum" / name;
  if (!std::filesystem::is_directory(path)) return std::nullopt;
  return path;
}

/// Points of a depth image in the world. @param rgb  CV_8UC3 in BGR order
inline WorldScan world_scan(const runtime::RgbdFrame& frame, const runtime::CameraConfig& camera,
                            const SE3<double>& T_w_c, int stride) {
  WorldScan scan;
  scan.origin = T_w_c.translation().cast<float>();
  for (int v = 0; v < frame.depth.rows; v += stride) {
    for (int u = 0; u < frame.depth.cols; u += stride) {
      const float z = frame.depth.at<float>(v, u);
      if (!is_valid_depth(z)) continue;
      const auto ideal = camera.model.undistort_pixel(Eigen::Vector2d(u, v));
      if (!ideal) continue;
      const Eigen::Vector3d p = T_w_c * Eigen::Vector3d(camera.model.pinhole().ray(*ideal) * double(z));
      const auto& bgr = frame.bgr.at<cv::Vec3b>(v, u);
      const bool left = u < frame.depth.cols / 2;  // labels of no meaning, in patches
      scan.points.push_back(
          {p.cast<float>(), static_cast<std::uint8_t>(left ? 2 : 0), {bgr[2], bgr[1], bgr[0]}});
    }
  }
  return scan;
}

/// `count` keyframes of fr1_xyz_first200, evenly spaced, at their ground-truth poses; empty where the data
/// are absent.
inline std::vector<WorldScan> recorded_scans(std::size_t count, int stride) {
  std::vector<WorldScan> scans;
  const auto folder = recorded_sequence("rgbd_dataset_freiburg1_xyz_first200");
  if (!folder) return scans;
  const runtime::Sequence sequence = runtime::load_sequence(*folder);
  const runtime::CameraConfig camera = runtime::load_camera(sequence.camera_hint);
  for (std::size_t k = 0; k < count; ++k) {
    const auto& record = sequence.frames[k * sequence.frames.size() / count];
    const auto truth = std::min_element(
        sequence.groundtruth.begin(), sequence.groundtruth.end(), [&](const auto& a, const auto& b) {
          return std::abs(a.t - record.t_depth) < std::abs(b.t - record.t_depth);
        });
    scans.push_back(world_scan(runtime::decode_frame(record, k, camera), camera, truth->T_w_c, stride));
  }
  return scans;
}

/// A camera that turns in a room of 4 x 5 x 2.5 m with a table; noisy depth.
inline std::vector<WorldScan> room_scans(std::size_t count, int width, int height) {
  std::vector<WorldScan> scans;
  const Pinhole<double> camera(0.82 * width, 0.82 * width, 0.5 * width, 0.5 * height);
  std::uint32_t state = 12345;
  const auto noise = [&] {
    state = state * 1664525U + 1013904223U;
    return static_cast<double>(state >> 8) / 16777216.0 - 0.5;
  };
  for (std::size_t k = 0; k < count; ++k) {
    const double a = 0.05 * static_cast<double>(k);
    const SE3<double> T_w_c(SO3<double>::exp(Eigen::Vector3d(-0.2, a, 0)),
                            Eigen::Vector3d(0.03 * static_cast<double>(k), 0.013, 0.017));
    WorldScan scan;
    scan.origin = T_w_c.translation().cast<float>();
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const Eigen::Vector3d ray = T_w_c.rotation_matrix() * camera.ray(Eigen::Vector2d(u, v));
        const Eigen::Vector3d eye = T_w_c.translation();
        double t = 100;
        for (int axis = 0; axis < 3; ++axis) {
          const double half = axis == 0 ? 2.0 : axis == 1 ? 1.25 : 2.5;
          if (std::abs(ray(axis)) < 1e-9) continue;
          t = std::min(t, (std::copysign(half, ray(axis)) - eye(axis)) / ray(axis));
        }
        const double table = (0.4 - eye.y()) / ray.y();
        const Eigen::Vector3d on_table = eye + ray * table;
        const bool is_table =
            table > 0 && table < t && std::abs(on_table.x()) < 0.6 && std::abs(on_table.z() - 1.4) < 0.4;
        if (is_table) t = table;
        const Eigen::Vector3d p = eye + ray * (t + 0.004 * t * t * noise());
        scan.points.push_back({p.cast<float>(),
                               static_cast<std::uint8_t>(is_table ? 2 : 0),
                               {static_cast<std::uint8_t>(u), static_cast<std::uint8_t>(v), 90}});
      }
    }
    scans.push_back(std::move(scan));
  }
  return scans;
}

}  // namespace dynslam::test
