// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime {

/// How long and how masks are carried on.
struct MaskKeeperOptions {
  int max_age = 8;             ///< frames that a mask outlives its last detection
  double max_seconds = 0;      ///< time that it does so instead [s]; 0: max_age counts
  int points = 60;             ///< corners that carry a mask
  int min_points = 6;          ///< fewer followed: the mask is dropped
  float depth_margin = 0.20F;  ///< metres around an object's depth that may be its own
  int band = 3;                ///< pixels around a mask that may be added to it by depth, per image
  int most_band = 24;          ///< and in all: a floor is as far away as what stands on it
  double redetected = 0.3;     ///< share of a kept mask under new detections from which it is replaced
  double max_cover = 0.8;      ///< share of the image above which kept masks are given up
};

/// Makes the masks of a network hold up: cuts them to the object's depth, and carries those that the
/// network misses, or has no time for, forward by optical flow and depth.
class MaskKeeper {
 public:
  explicit MaskKeeper(const MaskKeeperOptions& options = {}) : options_(options) {}

  /// @param detected  masks of this image; nullopt where the network was not asked
  /// @param gray      CV_8UC1
  /// @param depth     CV_32FC1 metres, invalid: NaN or <= 0
  /// @param t         time of the image [s], for `max_seconds`
  /// @throws UsageError for images of another type, or not of one size, that of the calls before
  [[nodiscard]] Masks update(const std::optional<Masks>& detected, const cv::Mat& gray, const cv::Mat& depth,
                             double t = 0);

  /// Masks of the last call that were carried, not detected.
  [[nodiscard]] int carried() const { return carried_; }

 private:
  struct Kept {
    cv::Rect at;      // of the image; outside there is nothing of it
    cv::Mat mask;     // CV_8UC1, 0 or 255
    cv::Mat reach;    // what it may ever cover, carried along
    float depth = 0;  // median [m]; 0 unknown
    int age = 0;
    double seen = 0;  // time of its last detection [s]
  };

  /// The parts of a mask: by instance where these are known, by connection otherwise.
  [[nodiscard]] std::vector<Kept> parts_of(const Masks& masks) const;
  /// Cuts a part to the object's depth.
  void refine(Kept& part, const cv::Mat& whole_depth) const;
  /// Corners of a mask in (a part of) the last image, made smaller by whole blocks of pixels.
  /// @param origin  of `image` in the camera's image [px]
  [[nodiscard]] std::vector<cv::Point2f> corners_of(const Kept& kept, const cv::Mat& image, cv::Point origin,
                                                    int shrink, double distance) const;
  /// Corners of a mask that were found again in the present image, whose pyramid is ready [px].
  struct Followed {
    std::vector<cv::Point2f> from, to;
  };
  [[nodiscard]] Followed follow(const Kept& kept, const cv::Mat& gray) const;
  [[nodiscard]] bool outdated(Kept& kept, double t) const;
  [[nodiscard]] bool carry(Kept& kept, const cv::Mat& gray, const cv::Mat& depth) const;

  MaskKeeperOptions options_;
  std::vector<Kept> kept_;
  cv::Mat gray_;    // of the last call
  int shrink_ = 1;  // pixels of an image per pixel of the one in which motion is measured
  cv::Mat shrunk_;
  std::vector<cv::Mat> pyramid_;       // of the last image, where there was something to carry
  std::vector<cv::Mat> next_pyramid_;  // memory for the next one
  int carried_ = 0;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
