// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_record.hpp"

#include <fmt/format.h>

namespace dynslam::runtime::bag {
namespace {

std::uint64_t little_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k)
    value |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[k])) << (8 * k);
  return value;
}

}  // namespace

Fields::Fields(Bytes bytes, const Cursor& cursor) {
  std::string_view rest(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  while (!rest.empty()) {
    const std::uint64_t size = rest.size() < 4 ? 0 : little_endian(rest.substr(0, 4));
    if (rest.size() < 4 || size > rest.size() - 4) cursor.fail("a header's field is longer than the header");
    const std::string_view field = rest.substr(4, static_cast<std::size_t>(size));
    const auto equals = field.find('=');
    if (equals == std::string_view::npos) cursor.fail("a header's field has no '='");
    fields_.emplace_back(field.substr(0, equals), field.substr(equals + 1));
    rest.remove_prefix(4 + field.size());
  }
}

std::optional<std::string_view> Fields::find(std::string_view name) const {
  for (const auto& [key, value] : fields_) {
    if (key == name) return value;
  }
  return std::nullopt;
}

std::string Fields::text(std::string_view name, const Cursor& cursor) const {
  const auto value = find(name);
  if (!value) cursor.fail(fmt::format("a header lacks '{}'", name));
  return std::string(*value);
}

std::uint64_t Fields::number(std::string_view name, std::size_t size, const Cursor& cursor) const {
  const std::string value = text(name, cursor);
  if (value.size() != size)
    cursor.fail(fmt::format("a header's '{}' has {} bytes, not {}", name, value.size(), size));
  return little_endian(value);
}

std::uint32_t Fields::u32(std::string_view name, const Cursor& cursor) const {
  return static_cast<std::uint32_t>(number(name, 4, cursor));
}

std::uint64_t Fields::u64(std::string_view name, const Cursor& cursor) const {
  return number(name, 8, cursor);
}

Op Fields::op(const Cursor& cursor) const {
  const std::uint64_t op = number("op", 1, cursor);
  if (op < 2 || op > 7) cursor.fail(fmt::format("a record of unknown kind {}", op));
  return static_cast<Op>(op);
}

Record next_record(Cursor& cursor) {
  constexpr std::uint32_t kLongest = 1 << 20;  // bytes; usual headers have a hundred
  const std::uint32_t size = cursor.take_u32("a record's size");
  if (size > kLongest) cursor.fail(fmt::format("no record: a header of {} bytes", size));
  const Bytes bytes = cursor.take(size, "a record's header");
  Fields fields(bytes, cursor);
  const Op op = fields.op(cursor);
  const std::uint32_t data = cursor.take_u32("a record's size");
  if (data > cursor.left())
    cursor.fail(fmt::format("a record's data need {} bytes, {} are left", data, cursor.left()));
  return {std::move(fields), op, cursor.at(), data};
}

}  // namespace dynslam::runtime::bag
