// SPDX-License-Identifier: BSD-3-Clause
#include "io/binary_file.hpp"

#include <fmt/format.h>

#include <limits>

#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "io/check_sum.hpp"

namespace dynslam::runtime {
namespace {

std::uint64_t hash_of(std::string_view bytes) {
  CheckSum sum;
  sum.add(bytes);
  return sum.value();
}

}  // namespace

std::uint64_t write_binary(const std::filesystem::path& path, std::string_view magic, std::uint32_t version,
                           const BinaryWriter& content) {
  const std::uint64_t hash = hash_of(content.bytes());
  BinaryWriter head;
  head.put(version);
  head.put(static_cast<std::uint64_t>(content.bytes().size()));
  head.put(hash);
  AtomicFile file(path);
  file.stream() << magic << '\n' << head.bytes() << content.bytes();
  file.commit();
  return hash;
}

BinaryReader read_binary(const std::filesystem::path& path, std::string_view magic, std::uint32_t version,
                         std::uint32_t oldest) {
  // A map is as large as it is: its own size bounds it, once it has shown that it is one.
  std::string bytes = read_file(path, std::numeric_limits<std::uint64_t>::max());
  const auto refuse = [&](const std::string& reason) { throw InputError(path.string(), 0, reason); };
  const std::size_t head = magic.size() + 1;
  constexpr std::size_t kNumbers = 4 + 8 + 8;
  if (bytes.compare(0, head, std::string(magic) + '\n') != 0) refuse(fmt::format("is not a {} file", magic));
  if (bytes.size() < head + kNumbers) refuse("is truncated");
  BinaryReader numbers(bytes.substr(head, kNumbers), path);
  const auto found = numbers.get<std::uint32_t>();
  if (found < oldest || found > version)
    refuse(fmt::format("has version {}; this program reads version {}{}", found,
                       oldest < version ? fmt::format("{} to ", oldest) : "", version));
  const auto size = numbers.get<std::uint64_t>(), hash = numbers.get<std::uint64_t>();
  const std::string_view content = std::string_view(bytes).substr(head + kNumbers);
  if (content.size() != size) refuse(content.size() < size ? "is truncated" : "is longer than it says");
  if (hash_of(content) != hash) refuse("is corrupt: its check sum differs");
  return BinaryReader(std::move(bytes), path, head + kNumbers, found, hash);
}

}  // namespace dynslam::runtime
