// SPDX-License-Identifier: BSD-3-Clause
// A ROS bag of format 2.0, read by what stands in its records alone. Debian's librosbag-storage, which does
// the same, follows damaged records beyond the end of its buffers (17 of 450 damaged bags), and brings Python
// into the process; the tests compare with it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "io/bag/bag_record.hpp"
#include "io/bag/chunk_cache.hpp"
#include "io/bag/recording.hpp"

namespace dynslam::runtime::bag {

class BagFile : public Recording {
 public:
  /// Reads the connections. @throws InputError: no bag, another version, encrypted, not closed, damaged
  explicit BagFile(std::unique_ptr<const ByteSource> source);
  [[nodiscard]] const std::string& name() const override { return source_->name(); }
  [[nodiscard]] const std::map<std::uint32_t, Connection>& connections() const { return connections_; }

  /// A bag that is not whole is refused by now: nothing is missing.
  std::vector<std::string> scan(const Visit& visit) const override;
  [[nodiscard]] std::vector<std::uint8_t> read(const Place& place, std::uint32_t most = ~0U) const override;
  [[nodiscard]] std::string where(const Place& place, const std::string& topic) const override {
    return where_in_file(name(), topic, place);
  }

 private:
  void read_index();
  void read_connection(const Record& record, Cursor& cursor);
  void scan_chunk(const Record& record, std::uint64_t record_at, const Visit& visit) const;
  void scan_messages(Cursor cursor, std::uint64_t chunk, const Visit& visit) const;
  /// The chunk whose record stands there, decompressed.
  [[nodiscard]] ChunkCache::Chunk chunk_at(std::uint64_t record_at) const;
  [[nodiscard]] ChunkCache::Chunk read_chunk(std::uint64_t record_at) const;

  std::unique_ptr<const ByteSource> source_;
  std::uint64_t first_ = 0, index_ = 0;  // offsets of the first record behind the header, of the index
  std::map<std::uint32_t, Connection> connections_;
  mutable ChunkCache chunks_;
};

/// Whether a file begins as a bag of any version does.
[[nodiscard]] bool is_bag(const std::filesystem::path& path);

}  // namespace dynslam::runtime::bag
