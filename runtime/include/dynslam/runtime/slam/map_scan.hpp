// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/semantic/scan_voxels.hpp"

namespace dynslam::runtime {

/// Which pixels of a keyframe become map, and how much they count.
struct MapScanOptions {
  int pixel_stride = 2;    ///< every so many pixels in both directions
  double max_range = 4.0;  ///< metres along the optical axis; farther depth is too coarse to map
  double max_incidence =
      78;              ///< degrees between ray and surface normal; beyond, a pixel is grazing or at an edge
  int edge_reach = 2;  ///< pixels to the neighbours that this is measured with
  DepthNoise<float> noise;
};

class BinaryReader;
class BinaryWriter;

/// A keyframe reduced to what the map needs, in the camera's frame, so that it can be inserted again after
/// the pose was corrected. 3 bytes per sampled pixel and 3 more per pixel that becomes surface: about 400 kB
/// for a VGA image at stride 2.
class MapScan {
 public:
  /// What a sampled pixel says.
  enum class Use : std::uint8_t {
    nothing,  ///< no depth, or depth that cannot be trusted: at an edge or grazing
    free,     ///< the way to it is free, it is no surface of the map: on a mover, or out of range
    surface
  };

  [[nodiscard]] std::size_t bytes() const {
    return depth_.capacity() * sizeof(depth_[0]) + code_.capacity() + rgb_.capacity();
  }

  void write(BinaryWriter& out) const;
  /// @param samples  pixels that the camera's scans have. @throws InputError for what cannot be a scan
  [[nodiscard]] static MapScan read(BinaryReader& in, std::size_t samples);

 private:
  friend class MapScanner;
  static constexpr float kUnitsPerMetre = 5000.0F;  // 0.2 mm, as the sensor's own files
  std::vector<std::uint16_t> depth_;                // of all sampled pixels
  std::vector<std::uint8_t> code_;                  // Use in the upper two bits, label in the lower six
  std::vector<std::uint8_t> rgb_;                   // of the surface pixels, in turn
};

/// Turns keyframes into scans and scans into voxels. Lens distortion is undone per pixel, once.
class MapScanner {
 public:
  MapScanner(const PinholeBrownConrady<double>& camera, int width, int height, const MapScanOptions& options);

  /// Selects and packs the pixels of a keyframe.
  /// @param depth         CV_32FC1 metres, NaN = invalid
  /// @param dynamic_mask  CV_8UC1, nonzero is no surface of the map; may be empty
  /// @param labels        CV_8UC1 of Label, or empty; people are no surface of the map
  /// @param bgr           CV_8UC3
  [[nodiscard]] MapScan pack(const cv::Mat& depth, const cv::Mat& dynamic_mask, const cv::Mat& labels,
                             const cv::Mat& bgr) const;

  /// Pixels of a scan.
  [[nodiscard]] std::size_t samples() const { return pixels_.size(); }

  /// The voxels that a scan hits and passes. Rays end some standard deviations before the surface, those
  /// towards movers too; far surfaces count less. `out` is cleared and finished.
  void gather(const MapScan& scan, const SE3<double>& T_w_c, ScanVoxels& out) const;

 private:
  MapScanOptions options_;
  int width_, height_;
  float max_slope_;                    // of depth per pixel and metre of depth, at max_incidence
  std::vector<Eigen::Vector3f> rays_;  // per sampled pixel, z = 1
  std::vector<int> pixels_;            // its index in the image
};

}  // namespace dynslam::runtime
