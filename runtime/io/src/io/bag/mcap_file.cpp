// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/mcap_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_chunk.hpp"
#include "io/bag/ros_messages.hpp"
#include "io/zlib_stream.hpp"

namespace dynslam::runtime::bag {

/// Goes through a file once.
class McapFile::Scan {
 public:
  Scan(const McapFile& file, const Visit& visit)
      : file_(file), visit_(visit), channels_(file.index_.channels) {}

  std::vector<std::string> operator()() {
    if (!file_.index_.fault.empty())
      missing_.push_back(
          fmt::format("{}: its index is damaged and not used: {}", file_.name(), file_.index_.fault));
    Cursor cursor(*file_.source_, kMcapMagic.size(), file_.source_->size());
    if (!take_all(cursor)) {
      missing_.push_back(
          fmt::format("{}: was not closed, or was cut off: read up to byte {} of {}, {} messages",
                      file_.name(), reached_, file_.source_->size(), messages_));
      return missing_;
    }
    if (!file_.index_.has_end)
      missing_.push_back(
          fmt::format("{}: was cut off behind its messages, all of which are read", file_.name()));
    compare_counts();
    return missing_;
  }

 private:
  /// Whether the end of the messages was found.
  bool take_all(Cursor& cursor) {
    for (bool ended = false; !ended;) {
      reached_ = cursor.at();
      const auto record = next_mcap_record(cursor);
      if (!record && file_.index_.has_end) cursor.fail("a record that is none, or that does not end");
      if (!record) return false;
      ended = record->op == McapOp::data_end || record->op == McapOp::footer;
      try {
        take(cursor, *record, 0);
      } catch (const InputError&) {
        // A file that was not closed may end in bytes that were never written.
        if (file_.index_.has_end || visiting_) throw;
        return false;
      }
    }
    return true;
  }

  void take(Cursor& cursor, const McapRecord& record, std::uint64_t chunk) {
    if (record.op == McapOp::message) {
      take_message(cursor, record, chunk);
    } else if (record.op == McapOp::chunk) {
      if (chunk != 0) cursor.fail("a chunk within a chunk");
      if (is_of_use(record)) take_chunk(record);
      cursor.skip(record.end - record.at, "a chunk");
    } else {
      take_mcap_record(cursor, record, channels_);
    }
  }

  void take_message(Cursor& cursor, const McapRecord& record, std::uint64_t chunk) {
    constexpr std::uint64_t kBefore = 2 + 4 + 8 + 8;  // channel, number, two times
    const std::uint64_t size = record.end - record.at;
    if (size < kBefore) cursor.fail(fmt::format("a message's record of {} bytes", size));
    if (size - kBefore > kLargestChunk)
      cursor.fail(fmt::format("a message of {} bytes; at most {} are read", size - kBefore, kLargestChunk));
    const Bytes id = cursor.take(2, "a message");
    const auto channel = static_cast<std::uint16_t>(id[0] + 256U * id[1]);
    const Connection* connection = channels_.find(channel);
    if (connection == nullptr) cursor.fail(fmt::format("a message of the unknown channel {}", channel));
    visiting_ = true;
    visit_(*connection, {record.at + kBefore, chunk, static_cast<std::uint32_t>(size - kBefore)});
    visiting_ = false;
    ++counts_[channel];
    ++messages_;
    cursor.skip(size - 2, "a message");
  }

  void take_chunk(const McapRecord& record) {
    const McapChunk head = file_.chunk_head(record.begin);
    if (head.compression.empty()) {
      const PartOf part(*file_.source_, head.at, head.size,
                        fmt::format("{}: chunk at byte {}", file_.name(), record.begin));
      take_records(part, record.begin);
    } else {
      take_records(*file_.chunk_at(record.begin), record.begin);
    }
  }

  void take_records(const ByteSource& chunk, std::uint64_t chunk_at) {
    Cursor cursor(chunk, 0, chunk.size());
    while (cursor.left() > 0) {
      const auto record = next_mcap_record(cursor);
      if (!record) cursor.fail("a record that does not end within its chunk");
      take(cursor, *record, chunk_at);
    }
  }

  /// By the index: whether a chunk holds a message that a sequence is made of.
  bool is_of_use(const McapRecord& record) const {
    const auto found = file_.index_.chunks.find(record.begin);
    if (found == file_.index_.chunks.end()) return true;
    return std::any_of(found->second.begin(), found->second.end(), [&](std::uint16_t id) {
      const Connection* connection = file_.index_.channels.find(id);
      return connection == nullptr || is_read(*connection) || !serialisation_of(connection->encoding);
    });
  }

  void compare_counts() {
    for (const auto& [id, expected] : file_.index_.messages) {
      const Connection* connection = channels_.find(id);
      if (connection == nullptr || !is_read(*connection) || counts_[id] == expected) continue;
      missing_.push_back(fmt::format("{}: {} of {} messages of {} are in the file", file_.name(), counts_[id],
                                     expected, connection->topic));
    }
  }

  const McapFile& file_;
  const Visit& visit_;
  McapChannels channels_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint64_t reached_ = 0, messages_ = 0;
  bool visiting_ = false;  // what is thrown then is not of the file's records
  std::vector<std::string> missing_;
};

McapFile::McapFile(std::unique_ptr<const ByteSource> source) : source_(std::move(source)) {
  std::string start(static_cast<std::size_t>(std::min<std::uint64_t>(kMcapMagic.size(), source_->size())),
                    '\0');
  source_->read(0, {reinterpret_cast<std::uint8_t*>(start.data()), start.size()});
  constexpr std::size_t kAnyVersion = 5;
  if (!start.starts_with(kMcapMagic.substr(0, kAnyVersion)))
    throw InputError(name(), 0, "is no MCAP file: it does not begin as one");
  if (start != kMcapMagic) throw InputError(name(), 0, "is an MCAP file of another version than 0");
  index_ = read_mcap_index(*source_);
}

std::vector<std::string> McapFile::scan(const Visit& visit) const {
  return Scan(*this, visit)();
}

McapChunk McapFile::chunk_head(std::uint64_t record_at) const {
  Cursor cursor(*source_, record_at, source_->size());
  const auto record = next_mcap_record(cursor);
  if (!record || record->op != McapOp::chunk) cursor.fail("a chunk was expected");
  return read_mcap_chunk(cursor, *record);
}

ChunkCache::Chunk McapFile::chunk_at(std::uint64_t record_at) const {
  return chunks_.get(record_at, [&] { return read_chunk(record_at); });
}

ChunkCache::Chunk McapFile::read_chunk(std::uint64_t record_at) const {
  const McapChunk head = chunk_head(record_at);
  const std::string name = fmt::format("{}: chunk at byte {}", this->name(), record_at);
  if (std::max(head.size, head.packed) > kLargestChunk)
    throw InputError(
        name, 0,
        fmt::format("has {} bytes; at most {} are read", std::max(head.size, head.packed), kLargestChunk));
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(head.packed));
  source_->read(head.at, bytes);
  if (!head.compression.empty())
    bytes = decompress(head.compression, bytes, static_cast<std::uint32_t>(head.size), name);
  if (head.crc != 0 && crc32(bytes) != head.crc)
    throw InputError(name, 0, "is damaged: its check sum differs");
  return std::make_shared<const MemoryBytes>(name, std::move(bytes));
}

std::vector<std::uint8_t> McapFile::read(const Place& place, std::uint32_t most) const {
  std::vector<std::uint8_t> data(std::min(place.size, most));
  if (place.chunk == 0) {
    source_->read(place.at, data);
    return data;
  }
  // The beginning of a message alone needs nothing of what else is in a chunk that is not compressed.
  if (const McapChunk head = chunk_head(place.chunk); head.compression.empty() && data.size() < place.size)
    source_->read(head.at + place.at, data);
  else
    chunk_at(place.chunk)->read(place.at, data);
  return data;
}

}  // namespace dynslam::runtime::bag
