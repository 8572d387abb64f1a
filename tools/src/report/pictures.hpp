// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "report/payload.hpp"

namespace dynslam::runtime::reporting {

/// How finely frames are shown.
struct PictureLevel {
  int width;           ///< of colour pictures [px]; no more than the camera has
  int quality;         ///< of JPEG
  std::size_t stride;  ///< every so many frames
};

/// From fine to coarse: of as many frames as fit, the finest pictures that do.
[[nodiscard]] std::vector<PictureLevel> picture_levels(std::size_t frames);

/// The frames of the runs as pictures: colour, depth, masks, keypoints.
class Pictures {
 public:
  explicit Pictures(const Source& source);
  /// Bytes that a level takes, by a few frames.
  [[nodiscard]] std::size_t estimate(const PictureLevel& level) const;
  /// Puts them into the payload: {"frames": {"stride", "t", "stamp", "colour", "depth", "truth", "size",
  /// "mask_size", "image", "depth_range"}}, and into each of its runs {"shown": {"from", "masks",
  /// "keypoints", "state", "matches", "inliers", "keyframe"}}, all of them lists of one entry per picture,
  /// null where there is none.
  void put(const PictureLevel& level, json& payload, std::vector<std::string>& thinned) const;

 private:
  struct Picture;
  [[nodiscard]] Picture picture(std::size_t frame, const PictureLevel& level) const;
  [[nodiscard]] json masks(const RunFolder& run, const std::string& stamp, cv::Size size) const;
  void find_depth_range();

  const Source& source_;
  double near_ = 0.4, far_ = 4;  // of the depths' colours [m]
};

}  // namespace dynslam::runtime::reporting
