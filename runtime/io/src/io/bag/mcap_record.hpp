// SPDX-License-Identifier: BSD-3-Clause
// Records of MCAP files, version 0: https://mcap.dev/spec.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "io/bag/byte_source.hpp"
#include "io/bag/recording.hpp"

namespace dynslam::runtime::bag {

/// What a file begins and ends with.
inline constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";

enum class McapOp : std::uint8_t {
  footer = 2,
  schema = 3,
  channel = 4,
  message = 5,
  chunk = 6,
  chunk_index = 8,
  statistics = 11,
  data_end = 15
};

struct McapRecord {
  McapOp op;                     ///< any other number: a record that is of no use here
  std::uint64_t begin, at, end;  ///< of the record, of its content; its end
};
/// The next record, with the cursor before its content; nullopt where it does not end before the cursor's
/// end.
[[nodiscard]] std::optional<McapRecord> next_mcap_record(Cursor& cursor);

/// The head of a chunk: what it holds follows.
struct McapChunk {
  std::uint64_t at = 0, packed = 0, size = 0;  ///< offset, bytes in the file, bytes when decompressed
  std::uint32_t crc = 0;                       ///< of those; 0: not said
  std::string compression;                     ///< lz4, zstd, ...; empty: none
};
/// @param cursor  before the content of a chunk's record, which ends with `record` @throws InputError
[[nodiscard]] McapChunk read_mcap_chunk(Cursor& cursor, const McapRecord& record);

/// What channels there are, by their records and those of their schemas.
class McapChannels {
 public:
  /// @throws InputError (name)
  void add_schema(Bytes record, const std::string& name);
  void add_channel(Bytes record, const std::string& name);
  [[nodiscard]] const Connection* find(std::uint16_t channel) const;

 private:
  std::map<std::uint16_t, std::string> types_;  // by schema
  std::map<std::uint16_t, Connection> channels_;
};

/// Reads a record of which channels are made, or skips one of another kind.
/// @throws InputError
void take_mcap_record(Cursor& cursor, const McapRecord& record, McapChannels& channels);

/// "FILE: record at byte N"
[[nodiscard]] std::string mcap_record_name(const std::string& file, const McapRecord& record);

}  // namespace dynslam::runtime::bag
