// SPDX-License-Identifier: BSD-3-Clause
#include "io/binary_file.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>

#include "dynslam/runtime/io/atomic_file.hpp"

namespace dynslam::runtime {
namespace {

std::uint64_t hash_of(std::string_view bytes) {
  std::uint64_t h = 14695981039346656037ULL;
  for (const char c : bytes) h = (h ^ static_cast<std::uint8_t>(c)) * 1099511628211ULL;
  return h;
}

}  // namespace

void write_binary(const std::filesystem::path& path, std::string_view magic, std::uint32_t version,
                  const BinaryWriter& content) {
  BinaryWriter head;
  head.put(version);
  head.put(static_cast<std::uint64_t>(content.bytes().size()));
  head.put(hash_of(content.bytes()));
  AtomicFile file(path);
  file.stream() << magic << '\n' << head.bytes() << content.bytes();
  file.commit();
}

BinaryReader read_binary(const std::filesystem::path& path, std::string_view magic, std::uint32_t version) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw InputError(path.string(), 0, "cannot be opened");
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  const std::size_t head = magic.size() + 1;
  constexpr std::size_t kNumbers = 4 + 8 + 8;
  if (bytes.compare(0, head, std::string(magic) + '\n') != 0)
    throw InputError(path.string(), 0, fmt::format("is not a {} file", magic));
  if (bytes.size() < head + kNumbers) throw InputError(path.string(), 0, "is truncated");
  BinaryReader numbers(bytes.substr(head, kNumbers), path);
  if (const auto found = numbers.get<std::uint32_t>(); found != version)
    throw InputError(path.string(), 0,
                     fmt::format("has version {}; this program reads version {}", found, version));
  const auto size = numbers.get<std::uint64_t>(), hash = numbers.get<std::uint64_t>();
  bytes.erase(0, head + kNumbers);
  if (bytes.size() != size)
    throw InputError(path.string(), 0, bytes.size() < size ? "is truncated" : "is longer than it says");
  if (hash_of(bytes) != hash) throw InputError(path.string(), 0, "is corrupt: its check sum differs");
  return BinaryReader(std::move(bytes), path);
}

}  // namespace dynslam::runtime
