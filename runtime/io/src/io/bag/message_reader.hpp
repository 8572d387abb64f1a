// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "dynslam/geometry/se3.hpp"
#include "io/bag/byte_source.hpp"

namespace dynslam::runtime::bag {

/// How a message becomes bytes.
enum class Serialisation {
  ros1,  ///< one value after the other, little-endian
  cdr    ///< as ROS 2 (OMG's CDR, XCDR version 1): either byte order, numbers aligned to their size
};
/// Of what recordings call it; nullopt: it is not read.
[[nodiscard]] std::optional<Serialisation> serialisation_of(std::string_view encoding);

/// std_msgs/Header.
struct Header {
  std::uint32_t seconds = 0, nanoseconds = 0;  ///< the stamp; below 1e9
  std::string frame;                           ///< without the slash that old ones begin with
};

/// Takes one value of a message after the other; arrays and texts have their length before them. Every one
/// throws an InputError (name) where the message ends before it.
class MessageReader {
 public:
  /// @param whole  what the bytes are, for messages @throws InputError (name) for CDR of an unknown kind
  MessageReader(Bytes bytes, const std::string& name, Serialisation how, const char* whole = "the message");

  [[noreturn]] void fail(const std::string& reason) const;
  Bytes bytes(std::uint64_t size, const char* what);
  std::uint8_t u8(const char* what) { return bytes(1, what)[0]; }
  std::uint16_t u16(const char* what) { return static_cast<std::uint16_t>(number(2, what)); }
  std::uint32_t u32(const char* what) { return static_cast<std::uint32_t>(number(4, what)); }
  std::uint64_t u64(const char* what) { return number(8, what); }
  double f64(const char* what);
  std::string text(const char* what);
  /// Bytes with their number before them.
  Bytes array(const char* what) { return bytes(u32(what), what); }

  std::string frame(const char* what);
  Header header();
  /// Position (or translation) and quaternion.
  SE3<double> pose();
  [[nodiscard]] std::size_t left() const { return rest_.size(); }
  void end() const;

 private:
  std::uint64_t number(std::size_t size, const char* what);

  Bytes rest_;
  const std::string& name_;
  std::size_t size_;
  const char* whole_;
  Serialisation how_;
  bool big_endian_ = false;
};

}  // namespace dynslam::runtime::bag
