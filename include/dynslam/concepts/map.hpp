// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>
#include <cstdint>
#include <type_traits>

namespace dynslam {

class VoxelGrid;                      // semantic/voxel_key.hpp
struct VoxelKey;                      // semantic/voxel_key.hpp
enum class Occupancy : std::uint8_t;  // semantic/log_odds.hpp

namespace detail {
/// A visitor of no known type, as queries pass them.
template <class Key, class Voxel>
struct VoxelVisitor {
  void operator()(const Key&, const Voxel&) const {}
};
}  // namespace detail

/// A map of voxels that can be asked at any power-of-two coarseness; all that the queries of
/// semantic/map_query.hpp use.
///
/// `grid()` is the VoxelGrid whose keys address the voxels. `at(key, level)` is the state of the cell of
/// 2^level voxels along each edge that holds the key's voxel, level 0 to 16: a coarse cell is occupied where
/// any voxel in it is, and its label is that of its occupied voxels. `for_each_occupied(low, high, level, f)`
/// calls f(key, voxel) for each occupied cell of the level that touches the box of keys [low, high], both
/// ends included, in any order. A map may have a `Reader(map)` with `state(key, level)`, at(key, level).state
/// for less: rays and searches ask for nothing else of most cells. `Voxel` is the map's own: a
/// default-constructed one is unknown, its `state` an Occupancy.
template <class M>
concept VoxelMap = std::same_as<typename M::Key, VoxelKey> && std::semiregular<typename M::Voxel> &&
    requires(const M& map, const VoxelKey& key, int level, const typename M::Voxel& voxel,
             const detail::VoxelVisitor<VoxelKey, typename M::Voxel>& f) {
  requires std::same_as<std::remove_cvref_t<decltype(map.grid())>, VoxelGrid>;
  { voxel.state } -> std::convertible_to<Occupancy>;
  { map.at(key, level) } -> std::same_as<typename M::Voxel>;
  map.for_each_occupied(key, key, level, f);
};

/// A map of voxels that takes whole scans.
template <class M>
concept VoxelStore = VoxelMap<M> && requires(M& map, const typename M::Scan& scan) {
  map.integrate(scan);
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
