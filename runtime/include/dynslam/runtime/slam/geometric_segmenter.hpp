// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/image/depth_bounds.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam/frame.hpp"
#include "dynslam/runtime/slam/patch_matcher.hpp"
#include "dynslam/segment/mask.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam::runtime {

struct GeometryOptions {
  // Keypoints of the reference keyframe (paper, steps 5 to 8)
  int lk_points = 400;           ///< keypoints tracked at most
  int lk_window = 21;            ///< side of the Lucas-Kanade window [px]
  int lk_levels = 3;             ///< pyramid levels above the first
  double at_rest_px = 1.0;       ///< from where the pose expects it: needs no search by optical flow
  double confirmed_px = 1.0;     ///< between what the optical flow found and its patch: one and the same [px]
  double epipolar_px = 1.5;      ///< distance to the epipolar line that makes a mismatch [px]
  double min_parallax_px = 4.0;  ///< below: F is not estimated (degenerate)
  double nu = 5.0;               ///< degrees of freedom of the t-distribution
  double tau = 0.25;             ///< static weight below which a keypoint is dynamic (numerator nu + d)
  std::uint64_t seed = 1;        ///< of the RANSAC
  // Dense free-space check
  bool free_space = true;  ///< false: dynamic keypoints alone start the growing
  int stride = 4;          ///< pixels per cell of the reduced grid
  double max_depth = 5.0;  ///< metres; beyond, depth is too noisy to judge
  FreeSpaceMargins<float> margins;
  int carry_frames = 20;      ///< how long a mask survives without new evidence
  int min_seed_cells = 12;    ///< smaller seed groups are noise
  int min_region_cells = 30;  ///< smaller regions are dropped
  // Region growing
  float step_base = 0.03F;    ///< depth step between neighbouring cells [m]
  float step_quad = 0.010F;   ///< and its growth with z^2 [1/m]
  int growing_reach = 8;      ///< cells around fresh evidence that a region may fill
  int max_hole_cells = 600;   ///< larger holes in a mask stay open
  double max_fraction = 0.7;  ///< share of the valid depth beyond which a region has leaked
};

struct GeometryStatistics {
  int tracked = 0;  ///< reference keypoints followed into the frame
  int epipolar_outliers = 0;
  bool epipolar_used = false;
  int dynamic_keypoints = 0;  ///< static weight < tau
  double sigma_photometric = 0, sigma_reprojection = 0, sigma_depth_factor = 0;
  int seeds = 0;           ///< cells that start the growing
  int regions_leaked = 0;  ///< dropped by the guard
  double lk_ms = 0, residuals_ms = 0, dense_ms = 0, growing_ms = 0;
};

/// Pyramid of an image as the segmenter's optical flow wants it.
[[nodiscard]] std::vector<cv::Mat> flow_pyramid(const cv::Mat& gray, const GeometryOptions& options);

/// Finds what moves without knowing what it is (paper, steps 5 to 9), from a reference keyframe's
/// keypoints and from the space that earlier frames saw to be free.
class GeometricSegmenter {
 public:
  GeometricSegmenter(const CameraConfig& camera, const GeometryOptions& options);

  /// Makes `frame` the reference keyframe.
  void set_reference(const Frame& frame, const RgbdFrame& input, const ImagePyramid& pyramid);
  [[nodiscard]] bool has_reference() const { return !reference_.pixels.empty(); }
  /// Puts the reference where the map has its keyframe by now.
  void place_reference(const SE3<double>& T_c_w) { reference_.T_c_w = T_c_w; }

  /// Mask of moving pixels (CV_8UC1, 255) of the frame with the given initial pose.
  /// @param prior  a-priori dynamic mask (may be empty): its points never enter scales or F
  /// @param pyramid  of the image, as the feature extractor made it
  cv::Mat segment(const RgbdFrame& input, const ImagePyramid& pyramid, const SE3<double>& T_c_w,
                  const cv::Mat& prior, GeometryStatistics& statistics);

  /// Keeps the frame just segmented, with its final pose and mask, as evidence for later ones.
  /// Must be called once per tracked frame, after `segment` (or alone: the depth is reduced then).
  void remember(const cv::Mat& depth, const SE3<double>& T_c_w, const cv::Mat& dynamic_mask, bool segmented);

  /// Moves the frames that were remembered with a correction of the map: new T_c_w = old T_c_w D.
  void follow(const SE3<double>& D);

  /// Whether the surface at a pixel of the frame last segmented was seen in the same place long before.
  [[nodiscard]] bool verified_static(float u, float v) const;

  /// Reference keypoints of the last call, in this frame: pixel and verdict (for pictures).
  struct Match {
    cv::Point2f from, to;
    float weight;
    bool dynamic;
  };
  [[nodiscard]] const std::vector<Match>& matches() const { return matches_; }

 private:
  struct Reference {
    std::vector<cv::Mat> pyramid;
    std::vector<cv::Point2f> pixels;
    std::vector<PointPatch> patches;
    std::vector<Eigen::Vector2d> ideal;
    std::vector<Eigen::Vector3d> points;  ///< in its camera's frame [m]
    std::vector<std::uint8_t> pause;      ///< frames for which it is not searched
    cv::Mat gray;
    SE3<double> T_c_w;
  };
  struct View {
    DepthBounds<float> bounds;
    Image<std::uint8_t> dynamic;  ///< final mask on the reduced grid
    Image<std::uint8_t> age;      ///< frames since direct evidence
    SE3<double> T_c_w;
  };

  void reduce(const cv::Mat& depth);
  void track_reference(const RgbdFrame& input, const ImagePyramid& image, const SE3<double>& T_c_w,
                       const cv::Mat& prior, GeometryStatistics& statistics);
  void find_cells(const SE3<double>& T_v_c, std::size_t first, std::span<int> cell, std::span<float> z) const;
  void check_free_space(const SE3<double>& T_c_w);
  void add_keypoint_seeds();
  void grow(GeometryStatistics& statistics);
  void enlarge(const cv::Mat& depth, cv::Mat& mask);
  [[nodiscard]] int cell_of_pixel(float u, float v) const;

  CameraConfig camera_;
  GeometryOptions options_;
  int width_, height_;                // of the reduced grid
  std::vector<int> pixel_of_cell_;    // raw pixel index per cell, -1 outside
  std::vector<int> cell_of_pixel_;    // cell index per raw pixel, -1 outside
  std::vector<cv::Range> row_cells_;  // rows of cells that a row of raw pixels meets
  std::vector<float> ray_x_, ray_y_;  // per cell: x/z, y/z
  Reference reference_;
  std::deque<View> views_;   // newest first
  std::vector<View> spare_;  // memory of dropped views
  Image<float> depth_;       // reduced depth of the present frame
  Image<std::uint8_t> seed_, barrier_, mask_, age_, smooth_, zone_, verified_;
  RegionGrowingWorkspace growing_;
  MaskWorkspace morphology_;
  std::vector<std::uint8_t> region_age_;
  std::vector<Match> matches_;
};

}  // namespace dynslam::runtime
