// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace dynslam {

/// Votes for `N` labels, bounded: when one count is full all are halved, so old votes fade.
template <std::size_t N>
class LabelHistogram {
 public:
  using Label = std::uint8_t;

  /// Adds a vote; labels from N on are ignored.
  void add(Label label) {
    if (label >= N) return;
    if (votes_[label] == std::numeric_limits<std::uint8_t>::max()) {
      for (auto& v : votes_) v = static_cast<std::uint8_t>(v / 2);
    }
    ++votes_[label];
  }
  /// Adds another voxel's votes (children into their parent), scaled down together to fit.
  void merge(const LabelHistogram& other) {
    std::array<int, N> sum{};
    int largest = 0;
    for (std::size_t i = 0; i < N; ++i) {
      sum[i] = votes_[i] + other.votes_[i];
      largest = std::max(largest, sum[i]);
    }
    const int divisor = largest > std::numeric_limits<std::uint8_t>::max() ? 2 : 1;
    for (std::size_t i = 0; i < N; ++i) votes_[i] = static_cast<std::uint8_t>(sum[i] / divisor);
  }
  /// Label with most votes, the smaller one in a tie; 0 when there are none.
  [[nodiscard]] Label top() const {
    return static_cast<Label>(std::max_element(votes_.begin(), votes_.end()) - votes_.begin());
  }
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
  [[nodiscard]] int votes(Label label) const { return label < N ? votes_[label] : 0; }

 private:
  std::array<std::uint8_t, N> votes_{};
};

}  // namespace dynslam
