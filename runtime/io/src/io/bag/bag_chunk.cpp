// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_chunk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string_view>

#include "dynslam/runtime/error.hpp"
#ifdef DYNSLAM_HAVE_BZIP2
#include <bzlib.h>
#endif
#ifdef DYNSLAM_HAVE_LZ4
#include <lz4frame.h>
#endif
#ifdef DYNSLAM_HAVE_ZSTD
#include <zstd.h>
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

#ifdef DYNSLAM_HAVE_ZSTD
/// Up to `most` bytes. @return whether the end of the data was reached
bool unpack_zstd(Bytes packed, std::uint32_t most, std::vector<std::uint8_t>& out) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(),
                                                                          &ZSTD_freeDStream);
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t filled = 0, left = 1;
  std::uint8_t surplus = 0;
  while (left != 0) {
    if (filled < most) make_room(out, filled, most);
    const bool full = filled == most;  // what is left is the end with its check sum
    ZSTD_outBuffer part{full ? &surplus : out.data() + filled, full ? 1 : out.size() - filled, 0};
    const std::size_t used = in.pos;
    left = ZSTD_decompressStream(stream.get(), &part, &in);
    if (ZSTD_isError(left) != 0 || (part.pos == 0 && in.pos == used)) break;
    filled += part.pos;
    if (filled > most) break;
  }
  out.resize(std::min<std::size_t>(filled, most));
  return left == 0 && filled <= most;
}
#endif

struct Library {
  std::string_view compression, package, otherwise;
};
constexpr std::array<Library, 3> kLibraries{
    {{"bz2", "libbz2-dev", "decompress the bag (rosbag decompress FILE)"},
     {"lz4", "liblz4-dev", "decompress the bag (rosbag decompress FILE, mcap decompress FILE)"},
     {"zstd", "libzstd-dev", "decompress the recording (zstd -d FILE, mcap decompress FILE)"}}};

}  // namespace

bool can_decompress(const std::string& compression) {
#ifdef DYNSLAM_HAVE_BZIP2
  if (compression == "bz2") return true;
#endif
#ifdef DYNSLAM_HAVE_LZ4
  if (compression == "lz4") return true;
#endif
#ifdef DYNSLAM_HAVE_ZSTD
  if (compression == "zstd") return true;
#endif
  return compression == "none";
}

void require_decompression(const std::string& compression, const std::string& name) {
  const auto library = std::find_if(kLibraries.begin(), kLibraries.end(),
                                    [&](const Library& l) { return l.compression == compression; });
  if (library == kLibraries.end())
    throw InputError(name, 0, "is compressed in a way that is neither bz2 nor lz4 nor zstd");
  if (!can_decompress(compression))
    throw InputError(name, 0,
                     fmt::format("is compressed with {}, which this dynslam was built without: build it "
                                 "where {} is installed, or {}",
                                 compression, library->package, library->otherwise));
}

std::vector<std::uint8_t> decompress(const std::string& compression, [[maybe_unused]] Bytes packed,
                                     std::uint32_t size, const std::string& name) {
  require_decompression(compression, name);
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
#ifdef DYNSLAM_HAVE_ZSTD
  if (compression == "zstd") whole = unpack_zstd(packed, size, out) && out.size() == size;
#endif
  if (!whole)
    throw InputError(name, 0, fmt::format("is damaged: its {} data cannot be decompressed", compression));
  return out;
}

std::vector<std::uint8_t> decompress_zstd([[maybe_unused]] Bytes packed, [[maybe_unused]] std::uint32_t most,
                                          const std::string& name) {
  require_decompression("zstd", name);
  std::vector<std::uint8_t> out;
#ifdef DYNSLAM_HAVE_ZSTD
  const std::uint32_t limit = std::min(most, kLargestChunk);
  if (!unpack_zstd(packed, limit, out) && (limit < most || out.size() < limit))
    throw InputError(name, 0, "is damaged: its zstd data cannot be decompressed");
#endif
  return out;
}

}  // namespace dynslam::runtime::bag
