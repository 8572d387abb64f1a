// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"

namespace dynslam::runtime {

/// Reduced copies of an image. Pixel centres are at integers on every level.
struct ImagePyramid {
  std::vector<cv::Mat> levels;              ///< CV_8UC1, level 0 is the image
  std::vector<Eigen::Vector2d> pixel_size;  ///< of each level, in pixels of level 0

  [[nodiscard]] Eigen::Vector2d to_level(const Eigen::Vector2d& x0, int level) const {
    return (x0.array() + 0.5) / pixel_size[static_cast<std::size_t>(level)].array() - 0.5;
  }
  [[nodiscard]] Eigen::Vector2d to_base(const Eigen::Vector2d& x, int level) const {
    return (x.array() + 0.5) * pixel_size[static_cast<std::size_t>(level)].array() - 0.5;
  }
};

/// What a map point looked like in the keyframe it is compared with.
struct PointPatch {
  static constexpr int kSide = 20;  ///< pixels of its level; room for turning and scaling an 8 x 8 template
  std::array<std::uint8_t, static_cast<std::size_t>(kSide* kSide)> grey{};
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();  ///< where in `grey` the point lies
  std::int16_t level = -1;                           ///< pyramid level; -1: no patch (too near the border)
  int keyframe = -1;
  Eigen::Vector2f ideal = Eigen::Vector2f::Zero();  ///< undistorted pixel in that keyframe
  float depth = 0;                                  ///< and depth there [m]
};

struct PatchMatch {
  Eigen::Vector2d x = Eigen::Vector2d::Zero();  ///< recorded pixel
  int level = 0;
  float correlation = 0;
};

/// Change of an offset in a patch's image to the present one, in pixels of level 0. The patch is taken for a
/// plane that faced the camera which cut it; nullopt where the point is not in front of the present one.
/// @param p_c  the point in the present camera's frame [m]
/// @param R    rotation from the camera that cut the patch to the present one
[[nodiscard]] std::optional<Eigen::Matrix2d> patch_warp(const Pinhole<double>& camera,
                                                        const PointPatch& patch, const Eigen::Vector3d& p_c,
                                                        const Eigen::Matrix3d& R);

/// Finds map points in an image by their patches, with sub-pixel accuracy.
class PatchMatcher {
 public:
  /// Cuts the surroundings of pixel `x` out of `level`; `level` of the result is -1 at the border.
  [[nodiscard]] static PointPatch cut(const ImagePyramid& pyramid, const Eigen::Vector2d& x, int level);

  /// @param warp   change of an offset in the patch's image to the present one, in pixels of level 0
  /// @param start  expected pixel
  [[nodiscard]] static bool match(const ImagePyramid& pyramid, const PointPatch& patch,
                                  const Eigen::Matrix2d& warp, const Eigen::Vector2d& start, PatchMatch& out);
};

}  // namespace dynslam::runtime
