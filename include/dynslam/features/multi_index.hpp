// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/features/descriptor.hpp"

namespace dynslam {

struct PlaceIndexOptions {
  int asked = 400;        ///< features of an image that vote, evenly chosen: more tell the same
  int max_distance = 50;  ///< Hamming distance of two views of one corner
  int longest = 64;       ///< entries looked at under one value: what is everywhere tells nothing
};

/// Finds keyframes that may show the same place, by their binary descriptors.
///
/// Multi-index hashing (Norouzi, Punjani and Fleet, CVPR 2012): a descriptor is stored under each of its
/// sixteen 16-bit parts, and two views of one corner nearly always agree in at least one of them. There
/// is no vocabulary to train, to ship or to load: the index grows with the map, from the first keyframe.
class PlaceIndex {
 public:
  explicit PlaceIndex(const PlaceIndexOptions& options = {})
      : options_(options), heads_(kParts * kValues, -1) {}

  /// Adds the descriptors of the keyframe's features that show a map point.
  /// @param point  per descriptor: -1 is left out
  void add(int keyframe, std::span<const Descriptor> descriptors, std::span<const int> point) {
    DYNSLAM_ASSERT(keyframe >= 0 && descriptors.size() == point.size(), "every descriptor has a point or -1");
    const auto k = static_cast<std::size_t>(keyframe);
    if (removed_.size() <= k) removed_.resize(k + 1, 0);
    removed_[k] = 0;
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      if (point[i] < 0) continue;
      const auto id = static_cast<std::uint32_t>(descriptors_.size());
      descriptors_.push_back(descriptors[i]);
      for (std::size_t part = 0; part < kParts; ++part) {
        std::int32_t& head = heads_[part * kValues + part_of(descriptors[i], part)];
        entries_.push_back({keyframe, id, head});
        head = static_cast<std::int32_t>(entries_.size()) - 1;
      }
    }
  }

  /// Forgets a keyframe.
  void remove(int keyframe) {
    if (static_cast<std::size_t>(keyframe) < removed_.size())
      removed_[static_cast<std::size_t>(keyframe)] = 1;
  }

  /// Keyframes by the number of an image's descriptors that have a close one there: (votes, keyframe), most
  /// first, ties newer first.
  /// @param ignored  per descriptor: nonzero has no vote; may be empty
  void query(std::span<const Descriptor> descriptors, std::span<const std::uint8_t> ignored,
             std::vector<std::pair<int, int>>& out) {
    DYNSLAM_ASSERT(ignored.empty() || ignored.size() == descriptors.size(), "every descriptor has a flag");
    out.clear();
    votes_.assign(removed_.size(), 0);
    voted_.assign(removed_.size(), -1);
    const std::size_t step =
        std::max<std::size_t>(1, descriptors.size() / static_cast<std::size_t>(options_.asked));
    for (std::size_t i = 0; i < descriptors.size(); i += step) {
      if (ignored.empty() || ignored[i] == 0) vote(descriptors[i], static_cast<int>(i));
    }
    for (std::size_t k = 0; k < votes_.size(); ++k) {
      if (votes_[k] > 0) out.emplace_back(votes_[k], static_cast<int>(k));
    }
    std::sort(out.begin(), out.end(), std::greater<>());
  }

  /// The same for a frame: its descriptors, those that show a point (add) or do not move (query).
  template <class F>
  void add(int keyframe, const F& frame) {
    add(keyframe, frame.descriptors, frame.point);
  }
  template <class F>
  void query(const F& frame, std::vector<std::pair<int, int>>& out) {
    query(frame.descriptors, frame.dynamic, out);
  }

 private:
  struct Entry {
    int keyframe;
    std::uint32_t descriptor;  // of descriptors_
    std::int32_t next;         // of entries_, -1: last
  };
  static constexpr std::size_t kParts = 16, kValues = 65536;

  [[nodiscard]] static std::size_t part_of(const Descriptor& d, std::size_t part) {
    return static_cast<std::size_t>((d[part / 4] >> (16 * (part % 4))) & 0xFFFFU);
  }

  /// @param voter  names the descriptor: each has one vote for a keyframe
  void vote(const Descriptor& d, int voter) {
    for (std::size_t part = 0; part < kParts; ++part) {
      std::int32_t at = heads_[part * kValues + part_of(d, part)];
      for (int looked = 0; at >= 0 && looked < options_.longest; ++looked) {
        const Entry& e = entries_[static_cast<std::size_t>(at)];
        at = e.next;
        const auto k = static_cast<std::size_t>(e.keyframe);
        if (removed_[k] != 0 || voted_[k] == voter ||
            hamming_distance(d, descriptors_[e.descriptor]) > options_.max_distance)
          continue;
        voted_[k] = voter;
        ++votes_[k];
      }
    }
  }

  PlaceIndexOptions options_;
  std::vector<Descriptor> descriptors_;
  std::vector<Entry> entries_;
  std::vector<std::int32_t> heads_;  // newest entry per part and value
  std::vector<std::uint8_t> removed_;
  std::vector<int> votes_, voted_;  // per keyframe: votes; last feature that voted
};

}  // namespace dynslam
