// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/mcap_record.hpp"

#include <fmt/format.h>

#include "io/bag/message_reader.hpp"

namespace dynslam::runtime::bag {
namespace {

/// MCAP's records are serialised as ROS 1 has it.
MessageReader mcap_fields(Bytes record, const std::string& name) {
  return {record, name, Serialisation::ros1, "the record"};
}

}  // namespace

std::optional<McapRecord> next_mcap_record(Cursor& cursor) {
  constexpr std::uint64_t kBefore = 9;  // kind and size
  if (cursor.left() < kBefore) return std::nullopt;
  const std::uint64_t begin = cursor.at();
  const std::uint8_t op = cursor.take(1, "a record")[0];
  const std::uint64_t size = cursor.take_u64("a record");
  if (op == 0 || size > cursor.left()) return std::nullopt;
  return McapRecord{static_cast<McapOp>(op), begin, cursor.at(), cursor.at() + size};
}

McapChunk read_mcap_chunk(Cursor& cursor, const McapRecord& record) {
  McapChunk chunk;
  (void)cursor.take_u64("a chunk");  // first and last time
  (void)cursor.take_u64("a chunk");
  chunk.size = cursor.take_u64("a chunk");
  chunk.crc = cursor.take_u32("a chunk");
  const std::uint32_t length = cursor.take_u32("a chunk");
  constexpr std::uint32_t kLongest = 64;
  if (length > kLongest) cursor.fail(fmt::format("a compression with a name of {} bytes", length));
  const Bytes name = cursor.take(length, "a chunk");
  chunk.compression.assign(name.begin(), name.end());
  chunk.packed = cursor.take_u64("a chunk");
  chunk.at = cursor.at();
  if (chunk.at > record.end || chunk.packed != record.end - chunk.at)
    cursor.fail(
        fmt::format("a chunk of {} bytes in a record that has {}", chunk.packed, record.end - record.at));
  if (chunk.compression.empty() && chunk.size != chunk.packed)
    cursor.fail(fmt::format("a chunk of {} bytes that says it has {}", chunk.packed, chunk.size));
  return chunk;
}

void McapChannels::add_schema(Bytes record, const std::string& name) {
  MessageReader in = mcap_fields(record, name);
  const std::uint16_t id = in.u16("a schema");
  const std::string type = plain_type(in.text("a schema's name"));
  if (types_.try_emplace(id, type).first->second != type)
    in.fail(fmt::format("schema {} once more, with another name", id));
}

void McapChannels::add_channel(Bytes record, const std::string& name) {
  MessageReader in = mcap_fields(record, name);
  const std::uint16_t id = in.u16("a channel"), schema = in.u16("a channel");
  Connection connection;
  connection.topic = in.text("a channel's topic");
  connection.encoding = in.text("a channel's encoding");
  if (const auto type = types_.find(schema); type != types_.end()) connection.type = type->second;
  if (schema != 0 && connection.type.empty())
    in.fail(fmt::format("channel {} has the unknown schema {}", id, schema));
  if (channels_.try_emplace(id, connection).first->second != connection)
    in.fail(fmt::format("channel {} once more, with another meaning", id));
}

const Connection* McapChannels::find(std::uint16_t channel) const {
  const auto found = channels_.find(channel);
  return found == channels_.end() ? nullptr : &found->second;
}

void take_mcap_record(Cursor& cursor, const McapRecord& record, McapChannels& channels) {
  const std::uint64_t size = record.end - record.at;
  if (record.op != McapOp::schema && record.op != McapOp::channel) {
    cursor.skip(size, "a record");
    return;
  }
  constexpr std::uint64_t kLongest = 16 << 20;  // with the definition of the message
  if (size > kLongest) cursor.fail("a schema or channel of more than 16 MB");
  const Bytes bytes = cursor.take(size, "a record");
  const std::string name = mcap_record_name(cursor.name(), record);
  if (record.op == McapOp::schema)
    channels.add_schema(bytes, name);
  else
    channels.add_channel(bytes, name);
}

std::string mcap_record_name(const std::string& file, const McapRecord& record) {
  return fmt::format("{}: record at byte {}", file, record.begin);
}

}  // namespace dynslam::runtime::bag
