// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/bag/byte_source.hpp"

namespace dynslam::runtime::bag {

/// Most bytes of a chunk [rosbag's default: 768 KB and a message].
inline constexpr std::uint32_t kLargestChunk = 512U << 20U;

/// Decompresses a chunk.
/// @param compression  bz2, lz4 (frames) or zstd
/// @param size  bytes that it must have
/// @throws InputError (name): damaged, of another size, or dynslam was built without the library for it
[[nodiscard]] std::vector<std::uint8_t> decompress(const std::string& compression, Bytes packed,
                                                   std::uint32_t size, const std::string& name);

/// The first bytes of what zstd compressed, at most `most`; it need not say how many there are.
/// @throws InputError (name): damaged, or dynslam was built without zstd
[[nodiscard]] std::vector<std::uint8_t> decompress_zstd(Bytes packed, std::uint32_t most,
                                                        const std::string& name);

/// Whether this build can decompress "bz2", "lz4" or "zstd".
[[nodiscard]] bool can_decompress(const std::string& compression);
/// @throws InputError (name) where it cannot, which says what to do
void require_decompression(const std::string& compression, const std::string& name);

}  // namespace dynslam::runtime::bag
