// SPDX-License-Identifier: BSD-3-Clause
// Records of ROS bags, format 2.0: http://wiki.ros.org/Bags/Format/2.0.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/bag/byte_source.hpp"

namespace dynslam::runtime::bag {

enum class Op : std::uint8_t {
  message = 2,
  bag_header = 3,
  index = 4,
  chunk = 5,
  chunk_info = 6,
  connection = 7
};

/// name=value fields of a header.
class Fields {
 public:
  /// @throws InputError (the cursor's) for what is no header
  Fields(Bytes bytes, const Cursor& cursor);
  [[nodiscard]] std::optional<std::string_view> find(std::string_view name) const;
  /// @throws InputError where the field is missing or has another size
  [[nodiscard]] std::string text(std::string_view name, const Cursor& cursor) const;
  [[nodiscard]] std::uint32_t u32(std::string_view name, const Cursor& cursor) const;
  [[nodiscard]] std::uint64_t u64(std::string_view name, const Cursor& cursor) const;
  [[nodiscard]] Op op(const Cursor& cursor) const;

 private:
  [[nodiscard]] std::uint64_t number(std::string_view name, std::size_t size, const Cursor& cursor) const;
  std::vector<std::pair<std::string, std::string>> fields_;
};

struct Record {
  Fields fields;
  Op op;
  std::uint64_t data_at;
  std::uint32_t data_size;
};
/// Reads a record's header and the size of its data, before which the cursor then stands; the data are there.
/// @throws InputError
[[nodiscard]] Record next_record(Cursor& cursor);

}  // namespace dynslam::runtime::bag
