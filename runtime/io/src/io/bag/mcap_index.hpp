// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "io/bag/mcap_record.hpp"

namespace dynslam::runtime::bag {

/// The summary at the end of an MCAP file: it spares decompressing chunks that hold nothing of use, and tells
/// whether messages are missing.
struct McapIndex {
  McapChannels channels;
  std::map<std::uint64_t, std::vector<std::uint16_t>> chunks;  ///< channels in the chunk at this offset
  std::map<std::uint16_t, std::uint64_t> messages;             ///< their number by channel
  bool has_end = false;                                        ///< whether the file ends as it should
  std::string fault;                                           ///< why the summary is not used
};

/// Never throws for what is damaged: then the rest is read without it.
[[nodiscard]] McapIndex read_mcap_index(const ByteSource& source);

}  // namespace dynslam::runtime::bag
