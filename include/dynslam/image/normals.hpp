// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <concepts>
#include <limits>
#include <optional>
#include <type_traits>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image_row.hpp"

namespace dynslam {

/// How normals are taken from depth.
template <std::floating_point S>
struct NormalOptions {
  int reach = 2;  ///< [pixels] to the neighbours; more averages the noise of more pixels
  S max_slope =
      S(0.2);  ///< of depth, per metre of depth and `reach`: a larger step is an edge, not a surface
};

/// Unit normal of the surface at each pixel of a depth image, towards the camera: the cross product of the
/// differences of the points `reach` pixels to either side. NaN where one of the four has no valid depth or
/// no inverse in the camera, lies beyond an edge of depth, or outside the image.
/// @param out  image of Eigen vectors of 3, of the size of `depth` (asserted), e.g. Image<Eigen::Vector3f>
template <CameraModel C, DepthImage D, OutputImage Out>
  requires(FixedMatrix<typename std::remove_reference_t<Out>::Pixel, 3>)
void surface_normals(const C& camera, const D& depth, const NormalOptions<typename C::ScalarType>& options,
                     Out&& out) {
  using S = typename C::ScalarType;
  using Normal = typename std::remove_reference_t<Out>::Pixel;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  DYNSLAM_ASSERT(same_size(depth, out) && options.reach > 0, "equal sizes, reach > 0");
  const int w = depth.width(), h = depth.height(), r = options.reach;
  const auto point = [&](int u, int v, S z) -> std::optional<Vector3> {
    if (u < 0 || v < 0 || u >= w || v >= h) return std::nullopt;
    const S other = static_cast<S>(depth(u, v));
    if (!is_valid_depth(other) || !(std::abs(other - z) <= options.max_slope * z)) return std::nullopt;
    return camera.unproject(Eigen::Matrix<S, 2, 1>(static_cast<S>(u), static_cast<S>(v)), other);
  };
  const Normal none = Normal::Constant(std::numeric_limits<typename Normal::Scalar>::quiet_NaN());
  for (int v = 0; v < h; ++v) {
    for (int u = 0; u < w; ++u) {
      out(u, v) = none;
      const S z = static_cast<S>(depth(u, v));
      if (!is_valid_depth(z)) continue;
      const auto left = point(u - r, v, z), right = point(u + r, v, z), up = point(u, v - r, z),
                 down = point(u, v + r, z);
      if (!left || !right || !up || !down) continue;
      const Vector3 normal = (*down - *up).cross(*right - *left);
      const S length = normal.norm();
      if (length > S(0)) out(u, v) = (normal / length).template cast<typename Normal::Scalar>();
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
