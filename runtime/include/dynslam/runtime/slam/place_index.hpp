// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/runtime/slam/frame.hpp"

namespace dynslam::runtime {

/// Finds keyframes that may show the same place, by their binary descriptors.
///
/// Multi-index hashing (Norouzi, Punjani and Fleet, CVPR 2012): a descriptor is stored under each of its
/// sixteen 16-bit parts, and two views of one corner nearly always agree in at least one of them. There
/// is no vocabulary to train, to ship or to load: the index grows with the map, from the first keyframe.
class PlaceIndex {
 public:
  PlaceIndex();

  /// Adds the descriptors of the keyframe's features that show a map point.
  void add(int keyframe, const Frame& frame);
  /// Forgets a keyframe.
  void remove(int keyframe);

  /// Keyframes by the number of `frame`'s features outside its dynamic flags that have a close
  /// descriptor there: (votes, keyframe), most first, ties newer first.
  void query(const Frame& frame, std::vector<std::pair<int, int>>& out);

 private:
  struct Entry {
    int keyframe;
    std::uint32_t descriptor;  // of descriptors_
    std::int32_t next;         // of entries_, -1: last
  };
  static constexpr std::size_t kParts = 16, kValues = 65536;

  std::vector<Descriptor> descriptors_;
  std::vector<Entry> entries_;
  std::vector<std::int32_t> heads_;  // newest entry per part and value
  std::vector<std::uint8_t> removed_;
  std::vector<int> votes_, voted_;  // per keyframe: votes; last feature that voted
};

}  // namespace dynslam::runtime
