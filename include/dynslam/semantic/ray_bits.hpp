// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "dynslam/semantic/ray_traversal.hpp"
#include "dynslam/semantic/voxel_key.hpp"

namespace dynslam {

/// The voxels that many rays from one origin pass: those that traverse_ray() visits, to the bit, as one bit
/// each in the box around the rays.
///
/// To follow a ray voxel by voxel is a chain of additions and comparisons, each of which waits for the one
/// before. Two rays side by side, in the two lanes of a vector of doubles (which every x86-64 and arm64 has),
/// take as long as one; and a bit in a plain array is noted without looking for its block.
class RayBits {
 public:
  static constexpr std::size_t kMostWords = std::size_t(1) << 22;  ///< of the box: 32 MiB

  /// Follows the rays from `origin` to each of `ends`; those that leave the grid are left out.
  /// @return false, with nothing done, where the box is larger than kMostWords
  template <std::floating_point S>
  bool carve(const VoxelGrid& grid, const Eigen::Matrix<S, 3, 1>& origin,
             std::span<const Eigen::Matrix<S, 3, 1>> ends) {
    const auto first = grid.key(origin);
    if (!first) return true;
    VoxelKey low = *first, high = *first;
    keys_.clear();
    for (const auto& end : ends) {
      // The origin's own voxel stands for those outside, too: there is no way to follow.
      const VoxelKey key = grid.key(end).value_or(*first);
      keys_.push_back(key);
      for (std::size_t i = 0; i < 3; ++i) {
        low[i] = std::min(low[i], key[i]);
        high[i] = std::max(high[i], key[i]);
      }
    }
    if (!make_room(low, high)) return false;
    follow(grid, origin, *first, ends);
    return true;
  }

  /// Calls f(key, bits) for each run of eight voxels along x, from key[0] that is a multiple of 8, of which
  /// rays pass any (bit i: the voxel key + i), and forgets them.
  template <class F>
  void drain(F&& f) {
    std::size_t word = 0;
    for (int z = 0; z < size_[2]; ++z) {
      for (int y = 0; y < size_[1]; ++y) {
        for (int x = 0; x < size_[0]; x += 64, ++word) {
          std::uint64_t bits = words_[word];
          if (bits == 0) continue;
          words_[word] = 0;
          for (int k = x; bits != 0; bits >>= 8, k += 8) {
            if ((bits & 0xFF) == 0) continue;
            f(VoxelKey{{static_cast<std::uint16_t>(low_[0] + k), static_cast<std::uint16_t>(low_[1] + y),
                        static_cast<std::uint16_t>(low_[2] + z)}},
              static_cast<unsigned>(bits & 0xFF));
          }
        }
      }
    }
  }

 private:
  // Vectors as g++ and clang have them on every machine. What masks select is of 32-bit numbers: for wider
  // ones g++ makes selections out of the conjunctions, which SSE2 has not.
  using Double2 = double __attribute__((vector_size(16)));
  using Long2 = std::int64_t __attribute__((vector_size(16)));
  using Mask = std::int32_t __attribute__((vector_size(16)));

  /// Two rays: distances to the next faces, place in words_; as bits the distances between faces and the
  /// steps of the place.
  struct Lanes {
    Double2 tx, ty, tz, reach;
    Long2 at, dx, dy, dz, sx, sy, sz;
    std::int64_t target[2];
    std::int64_t sure[2];  // steps before the last kUnsure, of which none can be the last
  };
  static constexpr int kUnsure = 4;
  static Mask less(const Double2& a, const Double2& b) { return std::bit_cast<Mask>(a < b); }

  /// As a whole: a vector that is read after one of its halves was written has to wait for the memory.
  template <int k, class V, class T>
  static void put(V& lanes, const T& value) {
    lanes = k == 0 ? V{value, lanes[1]} : V{lanes[0], value};
  }

  bool make_room(const VoxelKey& low, const VoxelKey& high) {
    // Rounding may lead a ray past its end, by no more than a voxel or two (see traverse_ray).
    constexpr int kMargin = 2;
    std::size_t words = 1;
    for (std::size_t i = 0; i < 3; ++i) {
      low_[i] = int(low[i]) - kMargin;
      size_[i] = int(high[i]) + kMargin + 1 - low_[i];
    }
    low_[0] = low_[0] >= 0 ? low_[0] / 8 * 8 : -8;
    size_[0] = (int(high[0]) + kMargin + 1 - low_[0] + 63) / 64 * 64;
    for (std::size_t i = 0; i < 3; ++i) words *= static_cast<std::size_t>(size_[i]);
    words /= 64;
    if (words > kMostWords) return false;
    if (words_.size() < words) words_.resize(words, 0);
    return true;
  }
  [[nodiscard]] std::int64_t place(const VoxelKey& key) const {
    const auto along = [&](std::size_t i) { return std::int64_t(int(key[i]) - low_[i]); };
    return along(0) + size_[0] * (along(1) + size_[1] * along(2));
  }
  void mark(std::int64_t at) { words_[static_cast<std::size_t>(at >> 6)] |= std::uint64_t(1) << (at & 63); }

  /// @return whether there was a further ray; otherwise lane k stands still at the origin
  template <int k, std::floating_point S>
  bool load(Lanes& lanes, const VoxelGrid& grid, const Eigen::Matrix<S, 3, 1>& origin, const VoxelKey& first,
            std::span<const Eigen::Matrix<S, 3, 1>> ends) {
    detail::RayFaces faces;
    lanes.target[k] = -1;
    lanes.sure[k] = std::numeric_limits<std::int64_t>::max() / 2;  // room to add
    bool found = false;
    for (; next_ < ends.size() && !found; ++next_) {
      const VoxelKey& key = keys_[next_];
      if (key == first) continue;
      faces = detail::ray_faces<S>(grid, first, origin, ends[next_]);
      lanes.target[k] = place(key);
      // Rounding may leave out the last face along each axis: where that is one of a ray's last three steps,
      // it has passed the end before it was there.
      lanes.sure[k] = detail::face_count(first, key) - kUnsure;
      found = true;
    }
    const std::int64_t row = size_[0], plane = row * size_[1];
    put<k>(lanes.tx, faces.t[0]);
    put<k>(lanes.ty, faces.t[1]);
    put<k>(lanes.tz, faces.t[2]);
    put<k>(lanes.reach, faces.reach);
    put<k>(lanes.dx, std::bit_cast<std::int64_t>(faces.delta[0]));
    put<k>(lanes.dy, std::bit_cast<std::int64_t>(faces.delta[1]));
    put<k>(lanes.dz, std::bit_cast<std::int64_t>(faces.delta[2]));
    put<k>(lanes.sx, std::int64_t(faces.sign[0]));
    put<k>(lanes.sy, faces.sign[1] * row);
    put<k>(lanes.sz, faces.sign[2] * plane);
    put<k>(lanes.at, place(first));
    return found;
  }

  /// Steps and marks until a ray ends. @return the places then, not yet marked; -1: past the end
  std::array<std::int64_t, 2> step_both(Lanes& l) {
    Double2 tx = l.tx, ty = l.ty, tz = l.tz;
    Long2 at = l.at;
    const Double2 reach = l.reach;
    const auto dx = std::bit_cast<Mask>(l.dx), dy = std::bit_cast<Mask>(l.dy), dz = std::bit_cast<Mask>(l.dz),
               sx = std::bit_cast<Mask>(l.sx), sy = std::bit_cast<Mask>(l.sy), sz = std::bit_cast<Mask>(l.sz);
    const std::int64_t target_a = l.target[0], target_b = l.target[1];
    std::uint64_t* const words = words_.data();
    const auto step = [&] {
      const Mask x_before_y = less(tx, ty);
      const Mask x = x_before_y & less(tx, tz), y = ~x_before_y & less(ty, tz), z = ~(x | y);
      at += std::bit_cast<Long2>((sx & x) | (sy & y) | (sz & z));
      tx += std::bit_cast<Double2>(dx & x);
      ty += std::bit_cast<Double2>(dy & y);
      tz += std::bit_cast<Double2>(dz & z);
    };
    const auto mark_both = [&](std::int64_t a, std::int64_t b) {
      // Nearly every voxel was passed before, and what is not written need not be waited for by the next
      // ray's reading.
      if ((words[a >> 6] >> (a & 63) & words[b >> 6] >> (b & 63) & 1) != 0) [[likely]]
        return;
      words[a >> 6] |= std::uint64_t(1) << (a & 63);
      words[b >> 6] |= std::uint64_t(1) << (b & 63);
    };
    std::int64_t steps = std::max(std::min(l.sure[0], l.sure[1]), std::int64_t(0));
    for (std::int64_t k = steps; k > 0; --k) {
      step();
      mark_both(at[0], at[1]);
    }
    for (;;) {
      step();
      ++steps;
      const Mask past = less(reach, tx) & less(reach, ty) & less(reach, tz);
      const auto now = std::bit_cast<Long2>(std::bit_cast<Mask>(at) | past);
      // A ray that has taken all the steps there are has ended, too.
      const auto end_of = [&](std::size_t k) {
        return steps >= l.sure[k] + kUnsure + detail::kExtraSteps ? -1 : now[k];
      };
      const std::int64_t a = end_of(0), b = end_of(1);
      if (a == target_a || b == target_b || (a | b) < 0) {
        l.tx = tx;
        l.ty = ty;
        l.tz = tz;
        l.at = at;
        l.sure[0] -= steps;
        l.sure[1] -= steps;
        return {a, b};
      }
      mark_both(a, b);
    }
  }

  template <std::floating_point S>
  void follow(const VoxelGrid& grid, const Eigen::Matrix<S, 3, 1>& origin, const VoxelKey& first,
              std::span<const Eigen::Matrix<S, 3, 1>> ends) {
    Lanes l{};
    next_ = 0;
    if (!load<0>(l, grid, origin, first, ends)) return;
    mark(place(first));
    int live = load<1>(l, grid, origin, first, ends) ? 2 : 1;
    while (live > 0) {
      const auto [a, b] = step_both(l);
      const bool a_ends = a < 0 || a == l.target[0], b_ends = b < 0 || b == l.target[1];
      if (!a_ends) {
        mark(a);
      } else if (!load<0>(l, grid, origin, first, ends)) {
        --live;
      }
      if (!b_ends) {
        mark(b);
      } else if (!load<1>(l, grid, origin, first, ends)) {
        --live;
      }
    }
  }

  std::vector<VoxelKey> keys_;        // of the ends
  std::size_t next_ = 0;              // of the ends that is to be followed
  std::vector<std::uint64_t> words_;  // zero but while there is something to drain; x fastest
  std::array<int, 3> low_{}, size_{};
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
