// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/place_index.hpp"

#include <algorithm>
#include <cstddef>
#include <functional>

namespace dynslam::runtime {
namespace {

constexpr std::size_t kAsked = 400;  // features of a frame that vote, evenly chosen
constexpr int kClose = 50;           // Hamming distance of two views of one corner
constexpr int kLongest = 64;         // entries looked at under one value: what is everywhere tells nothing

std::size_t part_of(const Descriptor& d, std::size_t part) {
  return static_cast<std::size_t>((d[part / 4] >> (16 * (part % 4))) & 0xFFFFU);
}

}  // namespace

PlaceIndex::PlaceIndex() : heads_(kParts * kValues, -1) {}

void PlaceIndex::add(int keyframe, const Frame& frame) {
  if (removed_.size() <= static_cast<std::size_t>(keyframe))
    removed_.resize(static_cast<std::size_t>(keyframe) + 1, 0);
  removed_[static_cast<std::size_t>(keyframe)] = 0;
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    if (frame.point[i] < 0) continue;
    const auto id = static_cast<std::uint32_t>(descriptors_.size());
    descriptors_.push_back(frame.descriptors[i]);
    for (std::size_t part = 0; part < kParts; ++part) {
      std::int32_t& head = heads_[part * kValues + part_of(frame.descriptors[i], part)];
      entries_.push_back({keyframe, id, head});
      head = static_cast<std::int32_t>(entries_.size()) - 1;
    }
  }
}

void PlaceIndex::remove(int keyframe) {
  if (static_cast<std::size_t>(keyframe) < removed_.size()) removed_[static_cast<std::size_t>(keyframe)] = 1;
}

void PlaceIndex::query(const Frame& frame, std::vector<std::pair<int, int>>& out) {
  out.clear();
  votes_.assign(removed_.size(), 0);
  voted_.assign(removed_.size(), -1);
  const std::size_t step = std::max<std::size_t>(1, frame.features.size() / kAsked);
  for (std::size_t i = 0; i < frame.features.size(); i += step) {
    if (frame.dynamic[i] != 0) continue;
    const Descriptor& d = frame.descriptors[i];
    for (std::size_t part = 0; part < kParts; ++part) {
      std::int32_t at = heads_[part * kValues + part_of(d, part)];
      for (int looked = 0; at >= 0 && looked < kLongest; ++looked) {
        const Entry& e = entries_[static_cast<std::size_t>(at)];
        at = e.next;
        const auto k = static_cast<std::size_t>(e.keyframe);
        if (removed_[k] != 0 || voted_[k] == static_cast<int>(i) ||
            hamming_distance(d, descriptors_[e.descriptor]) > kClose) {
          continue;
        }
        voted_[k] = static_cast<int>(i);
        ++votes_[k];
      }
    }
  }
  for (std::size_t k = 0; k < votes_.size(); ++k) {
    if (votes_[k] > 0) out.emplace_back(votes_[k], static_cast<int>(k));
  }
  std::sort(out.begin(), out.end(), std::greater<>());
}

}  // namespace dynslam::runtime
