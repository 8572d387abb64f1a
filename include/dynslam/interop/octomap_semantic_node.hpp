// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <octomap/OcTreeNode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "dynslam/semantic/label_histogram.hpp"
#include "dynslam/semantic/scan_voxels.hpp"

namespace dynslam::interop {

template <std::size_t N>
class BasicSemanticOcTree;

/// Node of a SemanticOcTree: log-odds, votes for N labels, mean colour. With 8 labels 24 bytes, in a heap
/// cell of the size that ColorOcTree's 16 bytes take, too (glibc).
///
/// Free space carries neither label nor colour: what a voxel's votes said belongs to what was there.
template <std::size_t N>
class BasicSemanticOcTreeNode : public octomap::OcTreeNode {
  static_assert(N > 0 && N <= 255, "labels and their number are bytes");

 public:
  using Colour = std::array<std::uint8_t, 3>;  // R, G, B
  using Labels = LabelHistogram<N>;
  static constexpr int kMaxScans = 8;  ///< in the mean colour, which forgets from then on

  BasicSemanticOcTreeNode() = default;
  /// Deep copy: OctoMap's own would make children of the base type.
  BasicSemanticOcTreeNode(const BasicSemanticOcTreeNode& other)
      : octomap::OcTreeNode(), labels_(other.labels_), colour_(other.colour_), scans_(other.scans_) {
    value = other.value;
    if (other.children == nullptr) return;
    children = new octomap::AbstractOcTreeNode*[8];
    for (std::size_t i = 0; i < 8; ++i) {
      children[i] =
          other.children[i] == nullptr
              ? nullptr
              : new BasicSemanticOcTreeNode(*static_cast<const BasicSemanticOcTreeNode*>(other.children[i]));
    }
  }
  BasicSemanticOcTreeNode& operator=(const BasicSemanticOcTreeNode&) = delete;
  ~BasicSemanticOcTreeNode() = default;

  /// Same data; children are not looked at.
  bool operator==(const BasicSemanticOcTreeNode& other) const {
    return value == other.value && labels_ == other.labels_ && colour_ == other.colour_;
  }
  void copyData(const BasicSemanticOcTreeNode& from) {
    value = from.value;
    labels_ = from.labels_;
    colour_ = from.colour_;
    scans_ = from.scans_;
  }

  [[nodiscard]] const Labels& labels() const { return labels_; }
  [[nodiscard]] const Colour& colour() const { return colour_; }
  [[nodiscard]] bool labelled() const { return !labels_.empty(); }
  [[nodiscard]] std::uint8_t label() const { return labels_.top(); }

  /// Adds one scan's votes and colour.
  void observe(const BasicVoxelEnd<N>& end) {
    end.vote(labels_);
    // Running mean; with kMaxScans it begins to forget, so that a changed thing changes its colour.
    scans_ = static_cast<std::uint8_t>(std::min(scans_ + 1, kMaxScans));
    const Colour seen = end.colour();
    for (std::size_t c = 0; c < 3; ++c) {
      const int difference = int(seen[c]) - int(colour_[c]);
      const int n = scans_;
      colour_[c] =
          static_cast<std::uint8_t>(colour_[c] + (2 * difference + (difference < 0 ? -n : n)) / (2 * n));
    }
  }
  void forget_labels() {
    labels_.clear();
    colour_ = {};
    scans_ = 0;
  }

  /// Parent from children: the largest log-odds (as OctoMap), the sum of the votes, the mean colour of the
  /// labelled. Hides the base's function, so OctoMap's own updates carry labels, too.
  void updateOccupancyChildren() { fuse_children(1); }

  /// Data as writeData() wrote them; failbit for impossible ones.
  std::istream& readData(std::istream& s);
  /// Log-odds as float; the labels that have votes, with up to 8 labels a bit each, otherwise their number;
  /// then, if there are any: their votes (with more than 8 labels each after its label), colour, scans.
  std::ostream& writeData(std::ostream& s) const;

 private:
  template <std::size_t>
  friend class BasicSemanticOcTree;

  void fuse_children(int divisor) {
    float largest = -std::numeric_limits<float>::max();
    std::array<int, N> votes{};
    std::array<int, 3> colour{};
    int coloured = 0;
    if (children != nullptr) {
      for (std::size_t i = 0; i < 8; ++i) {
        if (children[i] == nullptr) continue;
        const auto& child = *static_cast<const BasicSemanticOcTreeNode*>(children[i]);
        largest = std::max(largest, child.value);
        if (child.scans_ == 0) continue;
        ++coloured;
        for (std::size_t l = 0; l < N; ++l) votes[l] += child.labels_.votes(static_cast<std::uint8_t>(l));
        for (std::size_t c = 0; c < 3; ++c) colour[c] += child.colour_[c];
      }
    }
    value = largest;
    if (coloured == 0) {
      forget_labels();
      return;
    }
    labels_ = Labels::from_sums(votes, divisor);
    for (std::size_t c = 0; c < 3; ++c)
      colour_[c] = static_cast<std::uint8_t>((colour[c] + coloured / 2) / coloured);
    scans_ = kMaxScans;
  }

  Labels labels_;
  Colour colour_{};
  std::uint8_t scans_ = 0;  // in the mean colour, at most kMaxScans; 0: neither label nor colour
};

template <std::size_t N>
std::ostream& BasicSemanticOcTreeNode<N>::writeData(std::ostream& s) const {
  s.write(reinterpret_cast<const char*>(&value), sizeof value);
  if constexpr (N <= 8) {
    unsigned mask = 0;
    for (std::uint8_t l = 0; l < N; ++l) mask |= labels_.votes(l) > 0 ? 1U << l : 0U;
    s.put(static_cast<char>(mask));
  } else {
    int voted = 0;
    for (std::size_t l = 0; l < N; ++l) voted += labels_.votes(static_cast<std::uint8_t>(l)) > 0 ? 1 : 0;
    s.put(static_cast<char>(voted));
  }
  if (labels_.empty()) return s;
  for (std::size_t l = 0; l < N; ++l) {
    const int votes = labels_.votes(static_cast<std::uint8_t>(l));
    if (votes == 0) continue;
    if constexpr (N > 8) s.put(static_cast<char>(l));
    s.put(static_cast<char>(votes));
  }
  for (const std::uint8_t c : colour_) s.put(static_cast<char>(c));
  return s.put(static_cast<char>(scans_));
}

template <std::size_t N>
std::istream& BasicSemanticOcTreeNode<N>::readData(std::istream& s) {
  const auto byte = [&s] {
    const int b = s.get();
    return static_cast<std::uint8_t>(b < 0 ? 0 : b);
  };
  float log_odds = 0;
  if (!s.read(reinterpret_cast<char*>(&log_odds), sizeof log_odds)) return s;
  const std::uint8_t voted = byte();  // a bit per label, or a number of labels
  std::array<std::uint8_t, N> votes{};
  Colour colour{};
  std::uint8_t scans = 0;
  if (voted != 0) {
    if constexpr (N <= 8) {
      for (std::size_t l = 0; l < N; ++l) {
        if ((voted >> l & 1) == 0) continue;
        votes[l] = byte();
        if (votes[l] == 0) s.setstate(std::ios::failbit);
      }
      if (voted >> N != 0) s.setstate(std::ios::failbit);
    } else {
      int previous = -1;
      for (int i = 0; i < int(voted) && s; ++i) {
        const std::uint8_t l = byte(), v = byte();
        if (l >= N || int(l) <= previous || v == 0) {
          s.setstate(std::ios::failbit);
          break;
        }
        votes[l] = v;
        previous = l;
      }
    }
    for (auto& c : colour) c = byte();
    scans = byte();
    if (scans == 0 || scans > kMaxScans) s.setstate(std::ios::failbit);
  }
  if (!std::isfinite(log_odds)) s.setstate(std::ios::failbit);
  if (!s) return s;
  value = log_odds;
  labels_ = Labels(votes);
  colour_ = colour;
  scans_ = scans;
  return s;
}

/// A node of this library's own maps.
using SemanticOcTreeNode = BasicSemanticOcTreeNode<kMapLabels>;
static_assert(sizeof(SemanticOcTreeNode) == sizeof(void*) + 16);

}  // namespace dynslam::interop

#include "dynslam/pop_macros.hpp"
