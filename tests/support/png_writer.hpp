// SPDX-License-Identifier: BSD-3-Clause
// PNG files byte by byte (RFC 2083), of kinds that OpenCV does not write.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace dynslam::test {

inline void append_number(std::string& out, std::uint32_t value) {
  for (const unsigned shift : {24U, 16U, 8U, 0U}) out += static_cast<char>(value >> shift & 0xFF);
}

inline std::uint32_t crc(std::string_view bytes) {
  std::uint32_t remainder = 0xFFFFFFFF;
  for (const char c : bytes) {
    remainder ^= static_cast<std::uint8_t>(c);
    for (int k = 0; k < 8; ++k) remainder = remainder >> 1 ^ (remainder & 1 ? 0xEDB88320 : 0);
  }
  return ~remainder;
}

inline std::string chunk(const std::string& name, const std::string& content) {
  std::string out;
  append_number(out, static_cast<std::uint32_t>(content.size()));
  out += name + content;
  append_number(out, crc(name + content));
  return out;
}

/// Not compressed at all, in blocks of 1,000 bytes.
inline std::string zlib_stored(const std::string& raw) {
  std::string out("\x78\x01", 2);
  std::uint32_t a = 1, b = 0;
  for (const char c : raw) {
    a = (a + static_cast<std::uint8_t>(c)) % 65521;
    b = (b + a) % 65521;
  }
  for (std::size_t at = 0; at < raw.size(); at += 1000) {
    const std::string part = raw.substr(at, 1000);
    const auto length = static_cast<unsigned>(part.size());
    out += at + 1000 >= raw.size() ? '\1' : '\0';
    for (const unsigned n : {length, ~length}) {
      out += static_cast<char>(n & 0xFF);
      out += static_cast<char>(n >> 8 & 0xFF);
    }
    out += part;
  }
  append_number(out, b << 16 | a);
  return out;
}

}  // namespace dynslam::test
