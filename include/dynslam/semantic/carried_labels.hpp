// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <type_traits>
#include <utility>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image_row.hpp"

namespace dynslam {

/// When two pixels of different images show the same surface.
template <std::floating_point S = float>
struct CarriedLabelsOptions {
  DepthNoise<S> noise;
  S sigmas = S(6);  ///< standard deviations by which the depth of the same surface may differ: both are noisy
  S slack = S(0.01);  ///< beside that, as a share of the depth: for the pose, and for the pixel's own size
};

/// Labels that were found in an earlier image, for the surfaces that this one shows again: each pixel takes
/// the label of the pixel that saw the same point, nearest to where it projects. What moved since, was hidden
/// or out of sight gets 0, as does a label that the new image cannot hold.
/// @param camera       that of both images
/// @param then_depth   of the earlier image [m], NaN = invalid
/// @param then_labels  of the earlier image, its size
/// @param depth        of this image [m], NaN = invalid
/// @param T_then_now   from this camera's frame to the earlier one's
/// @param out          labels of this image, of its size; every pixel is written
template <CameraModel Camera, DepthImage ThenDepth, LabelImage ThenLabels, DepthImage Depth,
          OutputLabelImage Out>
void carry_labels(const Camera& camera, const ThenDepth& then_depth, const ThenLabels& then_labels,
                  const Depth& depth, const SE3<typename Camera::ScalarType>& T_then_now, Out&& out,
                  const CarriedLabelsOptions<typename Camera::ScalarType>& options = {}) {
  using S = typename Camera::ScalarType;
  using Label = typename std::remove_reference_t<Out>::Pixel;
  DYNSLAM_ASSERT(same_size(then_depth, then_labels) && same_size(depth, out),
                 "labels have their depth's size");
  for (int v = 0; v < depth.height(); ++v) {
    auto to = image_row(out, v);
    for (int u = 0; u < depth.width(); ++u) {
      to[u] = Label(0);
      const auto z = static_cast<S>(depth(u, v));
      if (!is_valid_depth(z)) continue;
      const auto point = camera.unproject(Eigen::Matrix<S, 2, 1>(S(u), S(v)), z);
      if (!point) continue;
      const Eigen::Matrix<S, 3, 1> then = T_then_now * *point;
      const auto pixel = camera.project(then);
      if (!pixel) continue;
      const S x = std::floor(pixel->x() + S(0.5)), y = std::floor(pixel->y() + S(0.5));
      if (!(x >= S(0) && y >= S(0) && x < S(then_depth.width()) && y < S(then_depth.height()))) continue;
      const int i = static_cast<int>(x), j = static_cast<int>(y);
      const auto there = static_cast<S>(then_depth(i, j));
      if (!is_valid_depth(there)) continue;
      const S far = std::max(there, then.z());
      if (std::abs(there - then.z()) > options.sigmas * options.noise.sigma(far) + options.slack * far)
        continue;
      const auto label = then_labels(i, j);
      if (std::in_range<Label>(label)) to[u] = static_cast<Label>(label);
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
