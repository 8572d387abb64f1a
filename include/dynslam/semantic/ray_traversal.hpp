// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam {

namespace detail {

/// A ray's way through the faces between voxels, per axis. By default it has none and never ends.
struct RayFaces {
  std::array<double, 3> t{};      ///< distance along the ray to the next face
  std::array<double, 3> delta{};  ///< and from there to the one after; 0 where the ray meets none
  std::array<int, 3> sign{};      ///< of the direction
  double reach = std::numeric_limits<double>::infinity();  ///< length of the ray
};

/// Steps beyond the faces between a ray's end voxels that rounding may add, one per axis; no ray takes more.
inline constexpr int kExtraSteps = 3;

/// Faces between two voxels on any way from one to the other without detours.
[[nodiscard]] inline int face_count(const VoxelKey& a, const VoxelKey& b) {
  int sum = 0;
  for (std::size_t i = 0; i < 3; ++i) sum += std::abs(int(a[i]) - int(b[i]));
  return sum;
}

/// Direction and length [m] of a segment whose squared length S cannot hold: in voxels and double, where
/// every point of the grid is below 2^15.
template <std::floating_point S>
void scaled_direction(const VoxelGrid& grid, const Eigen::Matrix<S, 3, 1>& origin,
                      const Eigen::Matrix<S, 3, 1>& end, double (&direction)[3], double& length) {
  const double voxels = 1.0 / grid.resolution();
  double largest = 0;
  for (Eigen::Index i = 0; i < 3; ++i) {
    direction[i] = static_cast<double>(end(i)) * voxels - static_cast<double>(origin(i)) * voxels;
    largest = std::max(largest, std::abs(direction[i]));
  }
  double sum = 0;
  for (double& d : direction) {
    d /= largest;
    sum += d * d;
  }
  const double norm = std::sqrt(sum);
  for (double& d : direction) d /= norm;
  length = largest * norm * grid.resolution();
}

/// @param first  voxel of `origin`, another one than that of `end`
template <std::floating_point S>
[[nodiscard]] RayFaces ray_faces(const VoxelGrid& grid, const VoxelKey& first,
                                 const Eigen::Matrix<S, 3, 1>& origin, const Eigen::Matrix<S, 3, 1>& end) {
  const S dx = end.x() - origin.x(), dy = end.y() - origin.y(), dz = end.z() - origin.z();
  const S square = dx * dx + dy * dy + dz * dz;
  const S length = static_cast<S>(std::sqrt(static_cast<double>(square)));
  double direction[3] = {static_cast<double>(dx / length), static_cast<double>(dy / length),
                         static_cast<double>(dz / length)};
  RayFaces faces;
  faces.reach = static_cast<double>(length);
  if (!std::isnormal(square)) scaled_direction(grid, origin, end, direction, faces.reach);
  for (std::size_t i = 0; i < 3; ++i) {
    const int sign = direction[i] > 0 ? 1 : direction[i] < 0 ? -1 : 0;
    faces.sign[i] = sign;
    faces.t[i] = std::numeric_limits<double>::max();
    if (sign == 0) continue;
    const double face =
        grid.centre(first[i]) + static_cast<double>(static_cast<S>(sign * grid.resolution() * 0.5));
    faces.t[i] = (face - static_cast<double>(origin(static_cast<Eigen::Index>(i)))) / direction[i];
    faces.delta[i] = grid.resolution() / std::abs(direction[i]);
  }
  return faces;
}

}  // namespace detail

/// Calls `visit(PackedKey)` for each voxel on the segment between two points [m]: the first one's voxel
/// first, the other's left out; nothing when both lie in one voxel. When `visit` returns bool, false
/// stops. It is called three times more at most than there are faces between the two voxels, however short
/// or long the segment.
///
/// J. Amanatides and A. Woo, A fast voxel traversal algorithm for ray tracing, Eurographics 1987, in the
/// arithmetic of OctoMap's computeRayKeys (direction in S, distances in double), so that with S = float the
/// voxels are the same ones. The step is chosen without branches: its direction is what a processor cannot
/// predict, and a wrong guess costs more than the whole step.
///
/// @return false when an end lies outside the grid; nothing is visited then
template <FixedMatrix<3> A, FixedMatrix<3> B, class Visit>
  requires std::floating_point<typename A::Scalar> && std::same_as<typename A::Scalar, typename B::Scalar>
bool traverse_ray(const VoxelGrid& grid, const Eigen::MatrixBase<A>& from, const Eigen::MatrixBase<B>& to,
                  Visit&& visit) {
  using S = typename A::Scalar;
  const Eigen::Matrix<S, 3, 1> origin = from, end = to;  // an expression is evaluated once
  const auto first = grid.key(origin), last = grid.key(end);
  if (!first || !last) return false;
  if (*first == *last) return true;
  PackedKey key = pack(*first);
  const PackedKey target = pack(*last);
  const auto go_on = [&visit](PackedKey k) {
    if constexpr (std::same_as<decltype(visit(k)), bool>) {
      return visit(k);
    } else {
      visit(k);
      return true;
    }
  };
  if (!go_on(key)) return true;

  const detail::RayFaces faces = detail::ray_faces<S>(grid, *first, origin, end);
  PackedKey delta[3];  // bits of the distance between faces
  PackedKey step[3];
  for (std::size_t i = 0; i < 3; ++i) {
    step[i] = static_cast<PackedKey>(static_cast<std::int64_t>(faces.sign[i])) << (21 * i);
    delta[i] = std::bit_cast<PackedKey>(faces.delta[i]);
  }
  const double reach = faces.reach;
  int steps = detail::face_count(*first, *last) + detail::kExtraSteps;
  double tx = faces.t[0], ty = faces.t[1], tz = faces.t[2];
  for (;;) {
    // As masks, and added as bits: a compiler turns conditions into jumps here.
    const PackedKey x_before_y = -PackedKey(tx < ty), x_before_z = -PackedKey(tx < tz),
                    y_before_z = -PackedKey(ty < tz);
    const PackedKey x_first = x_before_y & x_before_z;
    const PackedKey y_first = ~x_before_y & y_before_z;
    const PackedKey z_first = ~(x_first | y_first);
    key += (step[0] & x_first) + (step[1] & y_first) + (step[2] & z_first);
    tx += std::bit_cast<double>(delta[0] & x_first);
    ty += std::bit_cast<double>(delta[1] & y_first);
    tz += std::bit_cast<double>(delta[2] & z_first);
    // Rounding may lead past the target's voxel: the length ends the ray, too.
    if (key == target || --steps == 0 || std::min(std::min(tx, ty), tz) > reach || !go_on(key)) return true;
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
