// SPDX-License-Identifier: BSD-3-Clause
// An MCAP file, read by its records from front to end, also where its end is missing.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/bag/chunk_cache.hpp"
#include "io/bag/mcap_index.hpp"
#include "io/bag/recording.hpp"

namespace dynslam::runtime::bag {

class McapFile : public Recording {
 public:
  /// @throws InputError: no MCAP file, or of another version
  explicit McapFile(std::unique_ptr<const ByteSource> source);
  [[nodiscard]] const std::string& name() const override { return source_->name(); }
  /// Leaves out chunks that hold, by the index, no message that a sequence is made of.
  std::vector<std::string> scan(const Visit& visit) const override;
  [[nodiscard]] std::vector<std::uint8_t> read(const Place& place, std::uint32_t most = ~0U) const override;
  [[nodiscard]] std::string where(const Place& place, const std::string& topic) const override {
    return where_in_file(name(), topic, place);
  }

 private:
  class Scan;

  [[nodiscard]] McapChunk chunk_head(std::uint64_t record_at) const;
  /// The chunk whose record stands there, decompressed, its check sum compared.
  [[nodiscard]] ChunkCache::Chunk chunk_at(std::uint64_t record_at) const;
  [[nodiscard]] ChunkCache::Chunk read_chunk(std::uint64_t record_at) const;

  std::unique_ptr<const ByteSource> source_;
  McapIndex index_;
  mutable ChunkCache chunks_;
};

}  // namespace dynslam::runtime::bag
