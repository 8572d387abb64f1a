// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/semantic/cell_tree.hpp"
#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/log_odds.hpp"
#include "dynslam/semantic/scan_voxels.hpp"

namespace dynslam {

/// 8 x 8 x 8 voxels of a map in Morton order, as in ScanBlock: log-odds side by side, a bit for what is known
/// and occupied, and votes for labels of those occupied voxels alone in which a surface was measured.
template <std::floating_point S, std::size_t N>
class VoxelBlock {
 public:
  using Labels = LabelHistogram<N>;
  using Summary = CellSummary<S, N>;
  static constexpr std::size_t kVoxels = 512;

  [[nodiscard]] S log_odds(std::size_t i) const { return log_odds_[i]; }
  /// Votes of a voxel; none where it is not occupied.
  [[nodiscard]] Labels labels(std::size_t i) const {
    return (labelled_[i / 64] >> (i % 64) & 1) != 0 ? labels_[label_index(i)] : Labels();
  }
  /// Of a cell within the block: its 1, 8 or 64 voxels lie side by side in a word. @param first  its first
  /// voxel
  [[nodiscard]] Occupancy state(std::size_t first, int level) const {
    const std::uint64_t cell = cell_bits(first, level);
    if ((occupied_[first / 64] & cell) != 0) return Occupancy::occupied;
    return (known_[first / 64] & cell) != 0 ? Occupancy::free : Occupancy::unknown;
  }
  /// Of a voxel.
  [[nodiscard]] Occupancy state(std::size_t i) const {
    const std::uint64_t occupied = occupied_[i / 64] >> (i % 64) & 1, known = known_[i / 64] >> (i % 64) & 1;
    static_assert(int(Occupancy::unknown) == 0 && int(Occupancy::free) == 1 && int(Occupancy::occupied) == 2);
    return static_cast<Occupancy>(known + occupied);
  }
  /// What the voxels of a cell are together.
  [[nodiscard]] Summary summary(std::size_t first, int level) const {
    Summary sum;
    for (std::uint64_t bits = known_[first / 64] & cell_bits(first, level); bits != 0; bits &= bits - 1) {
      const std::size_t i = first / 64 * 64 + lowest(bits);
      sum.observe(log_odds_[i]);
      sum.count(labels(i));
    }
    return sum;
  }

  /// Fuses a scan's block (Eq 12) and keeps the summary of this one: votes by their differences, the largest
  /// log-odds anew where the voxel that had it sank. Free space has no labels, and forgets those it had.
  /// @param scratch  memory
  template <class Scan>
  void fuse(const Scan& scan, const ScanBlock& from, const LogOddsParams<S>& params, Summary& summary,
            std::vector<Labels>& scratch) {
    fuse_occupancy(scan, from, params, summary);
    std::array<std::uint64_t, 8> labelled;
    for (std::size_t w = 0; w < 8; ++w) labelled[w] = (labelled_[w] | from.hit[w]) & occupied_[w];
    if (labelled != labelled_) relabel(labelled, summary, scratch);
    for (std::size_t w = 0; w < 8; ++w) {
      for (std::uint64_t bits = from.hit[w] & labelled_[w]; bits != 0; bits &= bits - 1) {
        const std::size_t i = 64 * w + lowest(bits);
        Labels& votes = labels_[label_index(i)];
        summary.count(votes, -1);
        scan.end(from, i).vote(votes);
        summary.count(votes);
      }
    }
  }

 private:
  [[nodiscard]] static std::size_t lowest(std::uint64_t bits) {
    return static_cast<std::size_t>(std::countr_zero(bits));
  }
  [[nodiscard]] static std::uint64_t cell_bits(std::size_t first, int level) {
    return (~std::uint64_t(0) >> (64 - (1 << (3 * level)))) << (first % 64);
  }
  [[nodiscard]] std::size_t label_index(std::size_t i) const {
    auto before =
        static_cast<std::size_t>(std::popcount(labelled_[i / 64] & ~(~std::uint64_t(0) << (i % 64))));
    for (std::size_t w = 0; w < i / 64; ++w) before += static_cast<std::size_t>(std::popcount(labelled_[w]));
    return before;
  }

  template <class Scan>
  void fuse_occupancy(const Scan& scan, const ScanBlock& from, const LogOddsParams<S>& params,
                      Summary& summary) {
    bool sank = false;
    S highest = std::numeric_limits<S>::lowest();
    // Of word w the voxel of the lowest bit.
    const auto change = [&](std::size_t w, std::uint64_t bits, S measurement) {
      S& value = log_odds_[64 * w + lowest(bits)];
      const S before = value;
      value = fused_log_odds(before, measurement, params);
      const std::uint64_t bit = bits & -bits;
      occupied_[w] = (occupied_[w] & ~bit) | (bit & -std::uint64_t(value >= params.occupied));
      sank = sank || (before == summary.log_odds && value < before);
      highest = std::max(highest, value);
    };
    for (std::size_t w = 0; w < 8; ++w) {
      known_[w] |= from.miss[w] | from.hit[w];
      for (std::uint64_t bits = from.miss[w]; bits != 0; bits &= bits - 1) change(w, bits, params.miss);
      for (std::uint64_t bits = from.hit[w]; bits != 0; bits &= bits - 1)
        change(w, bits, static_cast<S>(scan.end(from, 64 * w + lowest(bits)).weight) * params.hit);
    }
    summary.observed = true;
    if (highest >= summary.log_odds) {
      summary.log_odds = highest;
    } else if (sank) {
      summary.log_odds = highest_log_odds();
    }
  }
  [[nodiscard]] S highest_log_odds() const {
    S highest = std::numeric_limits<S>::lowest();
    for (std::size_t w = 0; w < 8; ++w) {
      for (std::uint64_t bits = known_[w]; bits != 0; bits &= bits - 1)
        highest = std::max(highest, log_odds_[64 * w + lowest(bits)]);
    }
    return highest;
  }

  /// Makes room for votes of other voxels, and forgets those of voxels that have none any more.
  void relabel(const std::array<std::uint64_t, 8>& labelled, Summary& summary, std::vector<Labels>& scratch) {
    scratch.clear();
    auto old = labels_.begin();
    for (std::size_t w = 0; w < 8; ++w) {
      for (std::uint64_t bits = labelled[w] | labelled_[w]; bits != 0; bits &= bits - 1) {
        const std::uint64_t bit = bits & -bits;
        const bool had = (labelled_[w] & bit) != 0;
        if ((labelled[w] & bit) != 0) {
          scratch.push_back(had ? *old : Labels());
        } else {
          summary.count(*old, -1);
        }
        if (had) ++old;
      }
    }
    labels_.assign(scratch.begin(), scratch.end());
    labelled_ = labelled;
  }

  std::array<S, kVoxels> log_odds_{};
  std::array<std::uint64_t, 8> known_{}, occupied_{}, labelled_{};
  std::vector<Labels> labels_;  // of the labelled voxels, in their order
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
