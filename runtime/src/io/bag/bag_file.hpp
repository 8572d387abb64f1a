// SPDX-License-Identifier: BSD-3-Clause
// A ROS bag of format 2.0, read by what stands in its records alone. Debian's librosbag-storage, which does
// the same, follows damaged records beyond the end of its buffers (17 of 450 damaged bags), and brings Python
// into the process; the tests compare with it.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "io/bag/bag_record.hpp"

namespace dynslam::runtime::bag {

/// One publisher of a topic.
struct Connection {
  std::string topic, type;  ///< /camera/rgb/image_color, sensor_msgs/Image
};

/// Where a message's data lie: in the file, or in a chunk once that is decompressed.
struct Place {
  std::uint64_t at = 0;     ///< offset
  std::uint64_t chunk = 0;  ///< offset of the chunk's record in the file; 0: `at` is of the file
  std::uint32_t size = 0;
};

class BagFile {
 public:
  /// Reads the connections. @throws InputError: no bag, another version, encrypted, not closed, damaged
  explicit BagFile(std::unique_ptr<const ByteSource> source);
  [[nodiscard]] const std::string& name() const { return source_->name(); }
  [[nodiscard]] const std::map<std::uint32_t, Connection>& connections() const { return connections_; }

  /// Calls `visit` for every message, in the file's order. @throws InputError
  void scan(const std::function<void(std::uint32_t connection, const Place&)>& visit) const;

  /// The first bytes of a message's data, at most `most`. Any thread may ask. @throws InputError
  [[nodiscard]] std::vector<std::uint8_t> read(const Place& place, std::uint32_t most = ~0U) const;

 private:
  using Chunk = std::shared_ptr<const MemoryBytes>;

  void read_index();
  void read_connection(const Record& record, Cursor& cursor);
  void scan_chunk(const Record& record, std::uint64_t record_at,
                  const std::function<void(std::uint32_t, const Place&)>& visit) const;
  void scan_messages(Cursor cursor, std::uint64_t chunk,
                     const std::function<void(std::uint32_t, const Place&)>& visit) const;
  /// The chunk whose record stands there, decompressed; the last few are kept.
  [[nodiscard]] Chunk chunk_at(std::uint64_t record_at) const;

  std::unique_ptr<const ByteSource> source_;
  std::uint64_t first_ = 0, index_ = 0;  // offsets of the first record behind the header, of the index
  std::map<std::uint32_t, Connection> connections_;
  mutable std::mutex mutex_;
  mutable std::list<std::pair<std::uint64_t, Chunk>> kept_;  // the last one used comes first
};

/// Whether a file begins as a bag of any version does.
[[nodiscard]] bool is_bag(const std::filesystem::path& path);

}  // namespace dynslam::runtime::bag
