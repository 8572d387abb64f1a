// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <string_view>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_chunk.hpp"

namespace dynslam::runtime::bag {
namespace {

constexpr std::string_view kStart = "#ROSBAG V", kVersion = "#ROSBAG V2.0\n";
constexpr const char* kMend = "; `rosbag reindex FILE` makes the best of a bag that was cut off";

}  // namespace

bool is_bag(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  std::ifstream in(path, std::ios::binary);
  std::string start(kStart.size(), '\0');
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  return in.gcount() == static_cast<std::streamsize>(start.size()) && start == kStart;
}

BagFile::BagFile(std::unique_ptr<const ByteSource> source) : source_(std::move(source)) {
  const auto refuse = [&](const std::string& reason) { throw InputError(name(), 0, reason); };
  std::string start(static_cast<std::size_t>(std::min<std::uint64_t>(kVersion.size(), source_->size())),
                    '\0');
  source_->read(0, {reinterpret_cast<std::uint8_t*>(start.data()), start.size()});
  if (!start.starts_with(kStart)) refuse("is no ROS 1 bag: it does not begin with #ROSBAG");
  if (start != kVersion) refuse("is a bag of another version than 2.0; `rosbag fix` turns old ones into it");
  Cursor cursor(*source_, kVersion.size(), source_->size());
  const Record header = next_record(cursor);
  if (header.op != Op::bag_header) cursor.fail("a bag's header was expected");
  if (!header.fields.find("encryptor").value_or("").empty()) refuse("is encrypted, which is not read");
  index_ = header.fields.u64("index_pos", cursor);
  cursor.skip(header.data_size, "a bag's header");
  first_ = cursor.at();
  if (index_ == 0) refuse(fmt::format("has no index: it was not closed by its writer{}", kMend));
  if (index_ < first_) cursor.fail("the header puts the index before the first record");
  if (index_ > source_->size())
    refuse(fmt::format("is truncated: its index should be at byte {}, it ends at {}{}", index_,
                       source_->size(), kMend));
  const std::uint32_t connections = header.fields.u32("conn_count", cursor);
  read_index();
  if (connections_.size() != connections)
    refuse(fmt::format("is damaged or truncated: {} of {} connections are in its index{}",
                       connections_.size(), connections, kMend));
}

void BagFile::read_index() {
  Cursor cursor(*source_, index_, source_->size());
  while (cursor.left() > 0) {
    const Record record = next_record(cursor);
    if (record.op == Op::connection) {
      read_connection(record, cursor);
    } else if (record.op == Op::chunk_info) {
      cursor.skip(record.data_size, "a record");
    } else {
      cursor.fail("a record that does not belong into the index");
    }
  }
}

void BagFile::read_connection(const Record& record, Cursor& cursor) {
  constexpr std::uint32_t kLongest = 16 << 20;  // with the definition of the message
  if (record.data_size > kLongest) cursor.fail("a connection of more than 16 MB");
  const Fields data(cursor.take(record.data_size, "a connection"), cursor);
  const std::uint32_t id = record.fields.u32("conn", cursor);
  const Connection connection{record.fields.text("topic", cursor), data.text("type", cursor)};
  if (!connections_.emplace(id, connection).second) cursor.fail(fmt::format("connection {} once more", id));
}

std::vector<std::string> BagFile::scan(const Visit& visit) const {
  Cursor cursor(*source_, first_, index_);
  while (cursor.left() > 0) {
    const std::uint64_t at = cursor.at();
    const Record record = next_record(cursor);
    if (record.op == Op::chunk) {
      scan_chunk(record, at, visit);
    } else if (record.op != Op::index) {
      cursor.fail("a record that is neither a chunk nor its index");
    }
    cursor.skip(record.data_size, "a record");
  }
  return {};
}

void BagFile::scan_chunk(const Record& record, std::uint64_t record_at, const Visit& visit) const {
  const std::uint64_t end = record.data_at + record.data_size;
  Cursor cursor(*source_, record.data_at, end);
  if (record.fields.text("compression", cursor) == "none") {
    scan_messages(std::move(cursor), 0, visit);
    return;
  }
  const ChunkCache::Chunk chunk = chunk_at(record_at);
  scan_messages(Cursor(*chunk, 0, chunk->size()), record_at, visit);
}

void BagFile::scan_messages(Cursor cursor, std::uint64_t chunk, const Visit& visit) const {
  while (cursor.left() > 0) {
    const Record record = next_record(cursor);
    if (record.op == Op::message) {
      const std::uint32_t id = record.fields.u32("conn", cursor);
      const auto connection = connections_.find(id);
      if (connection == connections_.end())
        cursor.fail(fmt::format("a message of the unknown connection {}", id));
      visit(connection->second, {record.data_at, chunk, record.data_size});
    } else if (record.op != Op::connection) {  // those are in the index, too
      cursor.fail("a record that does not belong into a chunk");
    }
    cursor.skip(record.data_size, "a record");
  }
}

ChunkCache::Chunk BagFile::chunk_at(std::uint64_t record_at) const {
  return chunks_.get(record_at, [&] { return read_chunk(record_at); });
}

ChunkCache::Chunk BagFile::read_chunk(std::uint64_t record_at) const {
  Cursor cursor(*source_, record_at, index_);
  const Record record = next_record(cursor);
  const std::string name = fmt::format("{}: chunk at byte {}", this->name(), record_at);
  const std::string compression = record.fields.text("compression", cursor);
  const std::uint32_t size = record.fields.u32("size", cursor);
  if (record.data_size > kLargestChunk)
    throw InputError(name, 0,
                     fmt::format("has {} bytes; at most {} are read", record.data_size, kLargestChunk));
  const Bytes packed = cursor.take(record.data_size, "a chunk");
  return std::make_shared<const MemoryBytes>(name, decompress(compression, packed, size, name));
}

std::vector<std::uint8_t> BagFile::read(const Place& place, std::uint32_t most) const {
  std::vector<std::uint8_t> data(std::min(place.size, most));
  if (place.chunk == 0) {
    source_->read(place.at, data);
  } else {
    chunk_at(place.chunk)->read(place.at, data);
  }
  return data;
}

}  // namespace dynslam::runtime::bag
