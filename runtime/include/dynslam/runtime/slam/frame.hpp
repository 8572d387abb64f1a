// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/optim/pose.hpp"

namespace dynslam::runtime {

/// 256-bit binary descriptor (ORB).
using Descriptor = std::array<std::uint64_t, 4>;

/// Hamming distance of two descriptors, 0..256.
[[nodiscard]] inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
#if defined(__POPCNT__) || defined(__aarch64__)
  int distance = 0;
  for (std::size_t i = 0; i < a.size(); ++i) distance += std::popcount(a[i] ^ b[i]);
  return distance;
#else
  // Without the instruction std::popcount is a function call per word. Counting in parallel within all four
  // words, which are added as soon as their counts fit, takes a third of the time.
  constexpr std::uint64_t k1 = 0x5555555555555555U, k2 = 0x3333333333333333U, k4 = 0x0F0F0F0F0F0F0F0FU,
                          k8 = 0x00FF00FF00FF00FFU;
  const auto by_four = [](std::uint64_t x) {  // counts of 4 bits each, at most 4
    x -= (x >> 1) & k1;
    return (x & k2) + ((x >> 2) & k2);
  };
  const auto by_eight = [](std::uint64_t x) { return (x & k4) + ((x >> 4) & k4); };
  std::uint64_t n = by_eight(by_four(a[0] ^ b[0]) + by_four(a[1] ^ b[1])) +
                    by_eight(by_four(a[2] ^ b[2]) + by_four(a[3] ^ b[3]));  // at most 32 in each byte
  n = (n & k8) + ((n >> 8) & k8);
  return static_cast<int>((n * 0x0001000100010001U) >> 48);
#endif
}

/// One keypoint. `u, v` are pixels of the image as recorded; `x, y` the same point after
/// undistortion (ideal pinhole pixels), which is what all geometry uses.
struct Feature {
  float u = 0, v = 0;
  float x = 0, y = 0;
  float depth = 0;  ///< metres along the optical axis; <= 0: none
  float angle = 0;  ///< degrees, intensity-centroid orientation
  int octave = 0;
  float sigma = 1;  ///< standard deviation of x and y [px]
};

/// What a feature that shows the point `p_w` tells of the camera's pose.
[[nodiscard]] inline PoseObservation<double> observe(const Feature& f, const Eigen::Vector3d& p_w,
                                                     const DepthNoise<double>& noise) {
  const auto sigma = static_cast<double>(f.sigma), z = static_cast<double>(f.depth);
  return {p_w, Eigen::Vector2d(f.x, f.y), z, 1.0 / (sigma * sigma), f.depth > 0 ? noise.information(z) : 0.0};
}

/// Keypoints bucketed on a regular grid over the image for search by projection.
class FeatureGrid {
 public:
  /// @param width, height  image size in pixels; features outside are clamped into the border cells
  void build(std::span<const Feature> features, int width, int height);

  /// Calls `visit(index)` for each feature in a square of half side `radius` pixels around (x, y).
  template <class Visit>
  void for_each_near(std::span<const Feature> features, float x, float y, float radius, Visit&& visit) const {
    const int c0 = clamp_column(x - radius), c1 = clamp_column(x + radius);
    const int r0 = clamp_row(y - radius), r1 = clamp_row(y + radius);
    for (int r = r0; r <= r1; ++r) {
      for (int c = c0; c <= c1; ++c) {
        const auto cell = static_cast<std::size_t>(r * columns_ + c);
        for (int k = start_[cell]; k < start_[cell + 1]; ++k) {
          const int i = index_[static_cast<std::size_t>(k)];
          const Feature& f = features[static_cast<std::size_t>(i)];
          if (f.x >= x - radius && f.x <= x + radius && f.y >= y - radius && f.y <= y + radius) visit(i);
        }
      }
    }
  }

 private:
  static constexpr float kCell = 20.0F;
  [[nodiscard]] int clamp_column(float x) const;
  [[nodiscard]] int clamp_row(float y) const;
  int columns_ = 0, rows_ = 0;
  std::vector<int> start_, index_;  // CSR: features of cell i are index_[start_[i] .. start_[i + 1])
};

/// What the tracker keeps of one image.
struct Frame {
  std::size_t index = 0;
  double t = 0;
  std::vector<Feature> features;
  std::vector<Descriptor> descriptors;
  std::vector<int> point;             ///< map point of each feature, -1: none
  std::vector<std::uint8_t> dynamic;  ///< feature lies on the dynamic mask
  FeatureGrid grid;
  SE3<double> T_c_w;
};

}  // namespace dynslam::runtime
