// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/features/descriptor.hpp"

namespace dynslam {

/// Options of PlaceIndex.
struct PlaceIndexOptions {
  int asked = 400;        ///< features of an image that vote, evenly chosen: more tell the same
  int max_distance = 50;  ///< Hamming distance of two views of one corner
  /// Stored descriptors that one feature is compared with, about: the time of a query in a large map. Where
  /// more have a part in common with it, those with the parts that are rarest in the map are taken.
  int compared = 1024;
};

/// Finds keyframes that may show the same place, by their binary descriptors.
///
/// Multi-index hashing (Norouzi, Punjani and Fleet, CVPR 2012): a descriptor is stored under each of its
/// sixteen 16-bit parts, and two views of one corner nearly always agree in at least one of them. There
/// is no vocabulary to train, to ship or to load: the index grows with the map, from the first keyframe. A
/// query looks at whole lists, the shortest first: a part that is everywhere tells nothing, and no keyframe
/// is forgotten for its age.
class PlaceIndex {
 public:
  explicit PlaceIndex(const PlaceIndexOptions& options = {})
      : options_(options), heads_(kParts * kValues, kNone), lengths_(kParts * kValues, 0) {}

  /// Adds the descriptors of the keyframe's features that show a map point; what it had is replaced.
  /// @param point  per descriptor: -1 is left out
  void add(int keyframe, std::span<const Descriptor> descriptors, std::span<const int> point) {
    DYNSLAM_ASSERT(keyframe >= 0 && descriptors.size() == point.size(), "every descriptor has a point or -1");
    remove(keyframe);
    const auto k = static_cast<std::size_t>(keyframe);
    if (entries_of_.size() <= k) entries_of_.resize(k + 1);
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      if (point[i] >= 0) entries_of_[k].push_back(insert(keyframe, descriptors[i]));
    }
  }

  /// Forgets a keyframe: its entries are gone, and their memory serves the next ones.
  void remove(int keyframe) {
    if (keyframe < 0 || static_cast<std::size_t>(keyframe) >= entries_of_.size()) return;
    auto& entries = entries_of_[static_cast<std::size_t>(keyframe)];
    for (const std::int32_t e : entries) unlink(e);
    free_.insert(free_.end(), entries.begin(), entries.end());
    entries = {};
  }

  /// Descriptors stored.
  [[nodiscard]] std::size_t size() const { return entries_.size() - free_.size(); }

  /// Keyframes by the number of an image's descriptors that have a close one there: (votes, keyframe), most
  /// first, ties newer first.
  /// @param ignored  per descriptor: nonzero has no vote; may be empty
  void query(std::span<const Descriptor> descriptors, std::span<const std::uint8_t> ignored,
             std::vector<std::pair<int, int>>& out) {
    DYNSLAM_ASSERT(ignored.empty() || ignored.size() == descriptors.size(), "every descriptor has a flag");
    out.clear();
    votes_.assign(entries_of_.size(), 0);
    voted_.assign(entries_of_.size(), -1);
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
  static constexpr std::size_t kParts = 16, kValues = 65536;
  static constexpr std::int32_t kNone = -1;
  /// A descriptor, in a doubly linked list for each of its parts.
  struct Entry {
    Descriptor descriptor;
    int keyframe;  // beside what a query compares: lists lead all over the memory
    std::array<std::int32_t, kParts> next, previous;  // of entries_, kNone: end
  };

  /// The list of a descriptor's part.
  [[nodiscard]] static std::size_t list_of(const Descriptor& d, std::size_t part) {
    return part * kValues + static_cast<std::size_t>((d[part / 4] >> (16 * (part % 4))) & 0xFFFFU);
  }

  std::int32_t insert(int keyframe, const Descriptor& descriptor) {
    if (free_.empty()) {
      free_.push_back(static_cast<std::int32_t>(entries_.size()));
      entries_.emplace_back();
    }
    const std::int32_t at = free_.back();
    free_.pop_back();
    Entry& entry = entries_[static_cast<std::size_t>(at)];
    entry.descriptor = descriptor;
    entry.keyframe = keyframe;
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t list = list_of(descriptor, part);
      entry.previous[part] = kNone;
      entry.next[part] = heads_[list];
      if (heads_[list] != kNone) entries_[static_cast<std::size_t>(heads_[list])].previous[part] = at;
      heads_[list] = at;
      ++lengths_[list];
    }
    return at;
  }

  void unlink(std::int32_t at) {
    const Entry& entry = entries_[static_cast<std::size_t>(at)];
    for (std::size_t part = 0; part < kParts; ++part) {
      const std::size_t list = list_of(entry.descriptor, part);
      const std::int32_t next = entry.next[part], previous = entry.previous[part];
      (previous == kNone ? heads_[list] : entries_[static_cast<std::size_t>(previous)].next[part]) = next;
      if (next != kNone) entries_[static_cast<std::size_t>(next)].previous[part] = previous;
      --lengths_[list];
    }
  }

  /// @param voter  names the descriptor: each has one vote for a keyframe
  void vote(const Descriptor& d, int voter) {
    std::array<std::pair<std::int32_t, std::size_t>, kParts> lists;  // length, part
    for (std::size_t part = 0; part < kParts; ++part) lists[part] = {lengths_[list_of(d, part)], part};
    std::sort(lists.begin(), lists.end());
    int left = options_.compared;
    for (const auto& [length, part] : lists) {
      if (length > left) break;
      left -= length;
      for (std::int32_t at = heads_[list_of(d, part)]; at != kNone;) {
        const Entry& e = entries_[static_cast<std::size_t>(at)];
        at = e.next[part];
        const auto k = static_cast<std::size_t>(e.keyframe);
        if (voted_[k] == voter || hamming_distance(d, e.descriptor) > options_.max_distance) continue;
        voted_[k] = voter;
        ++votes_[k];
      }
    }
  }

  PlaceIndexOptions options_;
  std::vector<Entry> entries_;
  std::vector<std::int32_t> free_;                     // entries that nobody uses
  std::vector<std::vector<std::int32_t>> entries_of_;  // per keyframe
  std::vector<std::int32_t> heads_, lengths_;          // of the list of each part and value
  std::vector<int> votes_, voted_;                     // per keyframe: votes; last feature that voted
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
