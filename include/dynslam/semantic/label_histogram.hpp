// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "dynslam/config.hpp"

namespace dynslam {

/// Labels that the voxels of a map tell apart, unless the map is told another number of them.
inline constexpr std::size_t kMapLabels = 8;

/// Votes for `N` labels, bounded: when one count is full all are halved, so old votes fade.
///
/// The model: each scan casts a fixed number of votes for a voxel, shared among the labels of the pixels that
/// fell into it. A label's share of the votes is the estimate of its probability, i.e. the mean of a
/// Dirichlet posterior without prior whose evidence is forgotten by half every 255 votes for the leading
/// label.
/// @tparam N  number of labels, at most 256
template <std::size_t N>
class LabelHistogram {
  static_assert(N > 0 && N <= 256, "labels are bytes");

 public:
  using Label = std::uint8_t;
  static constexpr std::size_t kLabels = N;
  static constexpr int kMaxVotes = std::numeric_limits<std::uint8_t>::max();

  LabelHistogram() = default;
  /// From stored votes.
  explicit LabelHistogram(const std::array<std::uint8_t, N>& votes) : votes_(votes) {}

  /// Adds votes; labels from N on are ignored. @param n  at least 0; what does not fit is lost
  void add(Label label, int n = 1) {
    DYNSLAM_ASSERT(n >= 0, "votes are not taken back");
    if (label >= N) return;
    n = std::min(n, kMaxVotes);
    if (votes_[label] + n > kMaxVotes) {
      for (auto& v : votes_) v = static_cast<std::uint8_t>(v / 2);
    }
    votes_[label] = static_cast<std::uint8_t>(std::min(votes_[label] + n, kMaxVotes));
  }
  /// Adds another voxel's votes, scaled down together to fit.
  void merge(const LabelHistogram& other) {
    std::array<int, N> sum{};
    int largest = 0;
    for (std::size_t i = 0; i < N; ++i) {
      sum[i] = votes_[i] + other.votes_[i];
      largest = std::max(largest, sum[i]);
    }
    const int divisor = largest > kMaxVotes ? 2 : 1;
    for (std::size_t i = 0; i < N; ++i) votes_[i] = static_cast<std::uint8_t>(sum[i] / divisor);
  }
  /// From sums of votes (children into their parent): divided by `divisor`, or by more so that the largest
  /// fits, and rounded up, so that no vote vanishes. The top label is that of the sums.
  template <std::signed_integral I>
  [[nodiscard]] static LabelHistogram from_sums(const std::array<I, N>& sums, I divisor = 1) {
    const std::size_t top = first_of_most(sums);
    divisor = std::max(divisor, static_cast<I>((sums[top] + kMaxVotes - 1) / kMaxVotes));
    LabelHistogram out;
    for (std::size_t i = 0; i < N; ++i)
      out.votes_[i] = static_cast<std::uint8_t>((sums[i] + divisor - 1) / divisor);
    // Rounding may have made a tie, which another label would win.
    for (std::size_t i = 1; i < (top == 0 ? N : top); ++i)
      if (out.votes_[i] == out.votes_[top] && out.votes_[i] > 0) --out.votes_[i];
    return out;
  }
  void clear() { votes_ = {}; }

  /// Label with most votes; in a tie the smallest but 0, which stands for no label; 0 when there are none.
  [[nodiscard]] Label top() const { return static_cast<Label>(first_of_most(votes_)); }
  /// Share of the votes that the top label has; 0 when there are none.
  [[nodiscard]] double confidence() const {
    const int n = total();
    return n > 0 ? static_cast<double>(votes_[top()]) / n : 0.0;
  }
  [[nodiscard]] int total() const {
    int sum = 0;
    for (const auto v : votes_) sum += v;
    return sum;
  }
  [[nodiscard]] bool empty() const { return votes_ == std::array<std::uint8_t, N>{}; }
  [[nodiscard]] int votes(Label label) const { return label < N ? votes_[label] : 0; }
  bool operator==(const LabelHistogram&) const = default;

 private:
  template <class T>
  [[nodiscard]] static std::size_t first_of_most(const std::array<T, N>& votes) {
    const auto most = N > 1 ? std::max_element(votes.begin() + 1, votes.end()) : votes.begin();
    return *most > T(0) && *most >= votes[0] ? static_cast<std::size_t>(most - votes.begin()) : 0;
  }

  std::array<std::uint8_t, N> votes_{};
};

/// Votes for the classes of this library's own maps.
using MapLabels = LabelHistogram<kMapLabels>;

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
