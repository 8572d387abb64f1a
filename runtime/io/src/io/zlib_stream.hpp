// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace dynslam::runtime {

/// What became of a zlib stream.
enum class Inflated {
  whole,
  too_long,   ///< more than was asked for, by less than that and 1 MiB; or more than 2 GiB
  too_short,  ///< less
  broken,     ///< not to be decompressed, or its check sum differs
};

/// Decompresses zlib streams (RFC 1950) of known length: by ISA-L where the program was built with it, which
/// takes three quarters of the time, otherwise by libdeflate. Memory is kept between calls.
class ZlibInflater {
 public:
  ZlibInflater();
  ~ZlibInflater();
  ZlibInflater(const ZlibInflater&) = delete;
  ZlibInflater& operator=(const ZlibInflater&) = delete;

  /// @param parts  of the stream, in order
  /// @param out    as long as what is expected; any bytes where the stream is not whole
  [[nodiscard]] Inflated operator()(std::span<const std::span<const std::uint8_t>> parts,
                                    std::span<std::uint8_t> out);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The check sum of PNG's chunks (RFC 2083, 3.4).
[[nodiscard]] std::uint32_t crc32(std::span<const std::uint8_t> bytes);

}  // namespace dynslam::runtime
