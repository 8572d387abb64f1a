// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam {

/// Calls `visit(PackedKey)` for each voxel on the segment between two points [m]: the first one's voxel
/// first, the other's left out; nothing when both lie in one voxel. When `visit` returns bool, false
/// stops.
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

  const S dx = end.x() - origin.x(), dy = end.y() - origin.y(), dz = end.z() - origin.z();
  const S length = static_cast<S>(std::sqrt(static_cast<double>(dx * dx + dy * dy + dz * dz)));
  const S direction[3] = {dx / length, dy / length, dz / length};
  double t[3];         // distance along the ray to the next face, per axis
  PackedKey delta[3];  // bits of the distance between faces
  PackedKey step[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const int sign = direction[i] > S(0) ? 1 : direction[i] < S(0) ? -1 : 0;
    step[i] = static_cast<PackedKey>(static_cast<std::int64_t>(sign)) << (21 * i);
    t[i] = std::numeric_limits<double>::max();
    delta[i] = 0;
    if (sign == 0) continue;
    const double face =
        grid.centre((*first)[i]) + static_cast<double>(static_cast<S>(sign * grid.resolution() * 0.5));
    t[i] = (face - static_cast<double>(origin(static_cast<Eigen::Index>(i)))) /
           static_cast<double>(direction[i]);
    delta[i] = std::bit_cast<PackedKey>(grid.resolution() / std::abs(static_cast<double>(direction[i])));
  }
  const auto reach = static_cast<double>(length);
  double tx = t[0], ty = t[1], tz = t[2];
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
    if (key == target || std::min(std::min(tx, ty), tz) > reach || !go_on(key)) return true;
  }
}

}  // namespace dynslam
