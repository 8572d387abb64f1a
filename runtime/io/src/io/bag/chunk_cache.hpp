// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <utility>

#include "io/bag/byte_source.hpp"

namespace dynslam::runtime::bag {

/// The last few decompressed chunks of a file: colour and depth of a frame stand in one or in neighbours.
class ChunkCache {
 public:
  using Chunk = std::shared_ptr<const MemoryBytes>;

  /// The chunk at this offset; `make` reads and decompresses it where it is not kept. Any thread may ask.
  [[nodiscard]] Chunk get(std::uint64_t at, const std::function<Chunk()>& make);

 private:
  std::mutex mutex_;
  std::list<std::pair<std::uint64_t, Chunk>> kept_;  // the last one used comes first
};

}  // namespace dynslam::runtime::bag
