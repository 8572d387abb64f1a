// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_chunk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "dynslam/runtime/error.hpp"
#ifdef DYNSLAM_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef DYNSLAM_HAVE_LZ4
#include <lz4frame.h>
#endif

namespace dynslam::runtime::bag {
namespace {

/// Room for the next part: memory grows with what comes, whatever size a damaged header promises.
[[maybe_unused]] void make_room(std::vector<std::uint8_t>& out, std::size_t filled, std::uint32_t size) {
  constexpr std::size_t kFirst = 1 << 20;
  if (filled == out.size()) out.resize(std::min<std::size_t>(size, std::max(kFirst, 2 * out.size())));
}

#ifdef DYNSLAM_HAVE_BZIP2
/// @return whether the data are whole and of this size
bool unpack_bz2(Bytes packed, std::uint32_t size, std::vector<std::uint8_t>& out) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return false;
  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(packed.data()));
  stream.avail_in = static_cast<unsigned>(packed.size());
  std::size_t filled = 0;
  int state = BZ_OK;
  while (state == BZ_OK && filled < size) {
    make_room(out, filled, size);
    stream.next_out = reinterpret_cast<char*>(out.data() + filled);
    stream.avail_out = static_cast<unsigned>(out.size() - filled);
    state = BZ2_bzDecompress(&stream);
    const std::size_t now = out.size() - stream.avail_out;
    if (state == BZ_OK && now == filled && stream.avail_in == 0) state = BZ_UNEXPECTED_EOF;
    filled = now;
  }
  if (state == BZ_OK) {  // all bytes are there; the end with its check sum is still to come
    char surplus = 0;
    stream.next_out = &surplus;
    stream.avail_out = 1;
    state = BZ2_bzDecompress(&stream);
    if (stream.avail_out == 0) state = BZ_DATA_ERROR;
  }
  BZ2_bzDecompressEnd(&stream);
  return state == BZ_STREAM_END && filled == size;
}
#endif

#ifdef DYNSLAM_HAVE_LZ4
bool unpack_lz4(Bytes packed, std::uint32_t size, std::vector<std::uint8_t>& out) {
  LZ4F_decompressionContext_t context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) return false;
  std::size_t filled = 0, used = 0, hint = 1;
  std::uint8_t surplus = 0;
  while (hint != 0 && used < packed.size()) {
    if (filled < size) make_room(out, filled, size);
    std::uint8_t* to = filled < size ? out.data() + filled : &surplus;
    std::size_t room = filled < size ? out.size() - filled : 1, part = packed.size() - used;
    hint = LZ4F_decompress(context, to, &room, packed.data() + used, &part, nullptr);
    if (LZ4F_isError(hint) != 0 || (room == 0 && part == 0)) break;
    filled += room;
    used += part;
    if (filled > size) break;
  }
  LZ4F_freeDecompressionContext(context);
  return hint == 0 && filled == size;
}
#endif

}  // namespace

bool can_decompress(const std::string& compression) {
#ifdef DYNSLAM_HAVE_BZIP2
  if (compression == "bz2") return true;
#endif
#ifdef DYNSLAM_HAVE_LZ4
  if (compression == "lz4") return true;
#endif
  return compression == "none";
}

std::vector<std::uint8_t> decompress(const std::string& compression, [[maybe_unused]] Bytes packed,
                                     std::uint32_t size, const std::string& name) {
  if (compression != "bz2" && compression != "lz4")
    throw InputError(name, 0, "is compressed in a way that is neither bz2 nor lz4");
  if (!can_decompress(compression))
    throw InputError(
        name, 0,
        fmt::format("is compressed with {0}, which this dynslam was built without: build it where {1} is "
                    "installed, or decompress the bag (rosbag decompress FILE)",
                    compression, compression == "bz2" ? "libbz2-dev" : "liblz4-dev"));
  if (size > kLargestChunk)
    throw InputError(name, 0, fmt::format("has {} bytes; at most {} are read", size, kLargestChunk));
  std::vector<std::uint8_t> out;
  bool whole = false;
#ifdef DYNSLAM_HAVE_BZIP2
  if (compression == "bz2") whole = unpack_bz2(packed, size, out);
#endif
#ifdef DYNSLAM_HAVE_LZ4
  if (compression == "lz4") whole = unpack_lz4(packed, size, out);
#endif
  if (!whole)
    throw InputError(name, 0, fmt::format("is damaged: its {} data cannot be decompressed", compression));
  return out;
}

}  // namespace dynslam::runtime::bag
