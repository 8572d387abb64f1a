// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/mcap_index.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "dynslam/runtime/error.hpp"
#include "io/bag/message_reader.hpp"

namespace dynslam::runtime::bag {
namespace {

constexpr std::uint64_t kLongestIndex = 64 << 20;  // of a record; one of a chunk has ten bytes per channel

/// The pairs of a map in a record: a channel's number and eight bytes.
template <class Pair>
void take_pairs(MessageReader& in, Pair&& pair) {
  const Bytes bytes = in.array("a map");
  const std::string name = "map";
  MessageReader pairs(bytes, name, Serialisation::ros1, "the map");
  while (pairs.left() > 0) {
    const std::uint16_t channel = pairs.u16("a channel");
    pair(channel, pairs.u64("a number"));
  }
}

void add_chunk_index(MessageReader in, McapIndex& index) {
  (void)in.bytes(8 + 8, "times");
  const std::uint64_t at = in.u64("the chunk's offset");
  (void)in.u64("the chunk's length");
  std::vector<std::uint16_t> channels;
  take_pairs(in, [&](std::uint16_t channel, std::uint64_t) { channels.push_back(channel); });
  if (!channels.empty()) index.chunks.emplace(at, std::move(channels));
}

void add_statistics(MessageReader in, McapIndex& index) {
  (void)in.bytes(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8, "counts and times");
  take_pairs(in, [&](std::uint16_t channel, std::uint64_t count) { index.messages[channel] = count; });
}

void read_summary(Cursor cursor, McapIndex& index) {
  while (cursor.left() > 0) {
    const auto record = next_mcap_record(cursor);
    if (!record) cursor.fail("a record that does not end");
    if (record->op != McapOp::chunk_index && record->op != McapOp::statistics) {
      take_mcap_record(cursor, *record, index.channels);
      continue;
    }
    const std::uint64_t size = record->end - record->at;
    if (size > kLongestIndex) cursor.fail("a record of more than 64 MB");
    const Bytes bytes = cursor.take(size, "a record");
    const std::string name = mcap_record_name(cursor.name(), *record);
    const MessageReader in(bytes, name, Serialisation::ros1, "the record");
    if (record->op == McapOp::chunk_index)
      add_chunk_index(in, index);
    else
      add_statistics(in, index);
  }
}

}  // namespace

McapIndex read_mcap_index(const ByteSource& source) {
  constexpr std::uint64_t kFooter = 9 + 8 + 8 + 4;
  const std::uint64_t tail = kFooter + kMcapMagic.size();
  McapIndex index;
  if (source.size() < kMcapMagic.size() + tail) return index;
  Cursor cursor(source, source.size() - tail, source.size());
  const auto footer = next_mcap_record(cursor);
  if (!footer || footer->op != McapOp::footer || footer->end - footer->begin != kFooter) return index;
  const std::uint64_t summary = cursor.take_u64("the footer");
  cursor.skip(8 + 4, "the footer");
  const Bytes magic = cursor.take(kMcapMagic.size(), "the end");
  index.has_end =
      std::equal(magic.begin(), magic.end(), reinterpret_cast<const std::uint8_t*>(kMcapMagic.data()));
  if (!index.has_end || summary == 0) return index;
  try {
    read_summary(Cursor(source, summary, footer->begin), index);
  } catch (const InputError& error) {
    index = {};
    index.has_end = true;
    index.fault = error.what();
  }
  return index;
}

}  // namespace dynslam::runtime::bag
