// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

#include "dynslam/semantic/label_histogram.hpp"

namespace dynslam {

/// Votes that one scan casts for the label of one voxel.
inline constexpr int kVotesPerScan = 8;

/// What one scan measured on the surface in one voxel. @tparam N  number of labels
template <std::size_t N>
struct BasicVoxelEnd {
  std::array<std::uint32_t, N> label_samples{};
  std::array<std::uint32_t, 3> colour_sum{};  ///< R, G, B
  std::uint32_t samples = 0;
  float weight = 0;  ///< of the best sample; scales the log-odds of the hit

  /// Adds this scan's votes to a voxel's labels, kVotesPerScan of them shared by the labels' samples: whole
  /// votes first, those that are left to the largest remainders. So a label with more samples has no fewer
  /// votes, the one with the most has the most, and one with a share above 1 / (kVotesPerScan + 1) has one at
  /// least, however many labels there are. Ties go to smaller labels, to 0 (none) last.
  void vote(LabelHistogram<N>& labels) const {
    const Shares shares = shared();
    for (std::size_t i = 0; i < N; ++i)
      if (shares.votes[i] > 0) labels.add(static_cast<std::uint8_t>(i), shares.votes[i]);
  }
  [[nodiscard]] std::array<std::uint8_t, 3> colour() const {
    std::array<std::uint8_t, 3> mean{};
    for (std::size_t c = 0; c < 3; ++c)
      mean[c] = static_cast<std::uint8_t>((colour_sum[c] + samples / 2) / samples);
    return mean;
  }

 private:
  struct Shares {
    std::array<std::uint8_t, N> votes{};
    std::array<std::uint64_t, N + 1> rest{};  // of a vote, in samples; last: labels that the map has not
  };
  [[nodiscard]] Shares shared() const {
    Shares s;
    std::uint64_t left = kVotesPerScan, others = samples;
    for (std::size_t i = 0; i < N; ++i) {
      const std::uint64_t scaled = label_samples[i] * std::uint64_t(kVotesPerScan);
      s.votes[i] = static_cast<std::uint8_t>(scaled / samples);
      s.rest[i] = scaled % samples;
      left -= s.votes[i];
      others -= label_samples[i];
    }
    left -= others * kVotesPerScan / samples;
    s.rest[N] = others * kVotesPerScan % samples;
    for (; left > 0; --left) {
      const std::size_t i = first_of_most(s.rest);
      s.rest[i] = 0;
      if (i < N) ++s.votes[i];
    }
    // Rounding may have made a tie of the most frequent label with others: the least of them gives way.
    const std::size_t top = first_of_most(label_samples);
    std::size_t least = top;
    for (std::size_t i = 0; i < N; ++i)
      if (s.votes[i] > 0 && s.votes[i] == s.votes[top] && label_samples[i] <= label_samples[least]) least = i;
    if (label_samples[least] < label_samples[top]) {
      --s.votes[least];
      ++s.votes[top];
    }
    return s;
  }
  /// The first of the largest, 0 being the last one.
  template <std::size_t M, class T>
  [[nodiscard]] static std::size_t first_of_most(const std::array<T, M>& a) {
    std::size_t best = M > 1 ? 1 : 0;
    for (std::size_t k = 2; k <= M; ++k)
      if (a[k % M] > a[best]) best = k % M;
    return best;
  }
};
/// An end of this library's own maps.
using VoxelEnd = BasicVoxelEnd<kMapLabels>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
