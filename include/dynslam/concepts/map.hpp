// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>

namespace dynslam {

/// A map of voxels that takes whole scans and answers at any power-of-two coarseness.
///
/// `at(key, level)` is the state of the cell of 2^level voxels along each edge that holds the key's voxel: a
/// coarse cell is occupied where any voxel in it is, and its label is that of its occupied voxels.
/// `for_each_occupied(low, high, level, f)` calls f(key, voxel) for each occupied cell of the level that
/// touches the box of keys [low, high], both ends included.
template <class M>
concept VoxelStore = requires(M& map, const M& constant, const typename M::Key& key,
                              const typename M::Scan& scan, int level,
                              void (*f)(const typename M::Key&, const typename M::Voxel&)) {
  map.integrate(scan);
  constant.grid();
  { constant.at(key, level) } -> std::same_as<typename M::Voxel>;
  constant.for_each_occupied(key, key, level, f);
};

}  // namespace dynslam
