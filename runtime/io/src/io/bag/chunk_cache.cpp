// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/chunk_cache.hpp"

#include <algorithm>
#include <iterator>

namespace dynslam::runtime::bag {

ChunkCache::Chunk ChunkCache::get(std::uint64_t at, const std::function<Chunk()>& make) {
  const std::lock_guard lock(mutex_);
  const auto found =
      std::find_if(kept_.begin(), kept_.end(), [&](const auto& kept) { return kept.first == at; });
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return kept_.front().second;
  }
  constexpr std::size_t kKept = 3;
  constexpr std::uint64_t kMost = 256 << 20;  // bytes that are kept beside the last one
  kept_.emplace_front(at, make());
  std::uint64_t bytes = 0;
  for (auto it = std::next(kept_.begin()); it != kept_.end(); ++it) bytes += it->second->size();
  while (kept_.size() > 1 && (kept_.size() > kKept || bytes > kMost)) {
    bytes -= kept_.back().second->size();
    kept_.pop_back();
  }
  return kept_.front().second;
}

}  // namespace dynslam::runtime::bag
