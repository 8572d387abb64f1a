// SPDX-License-Identifier: BSD-3-Clause
#include "io/zlib_stream.hpp"

#ifdef DYNSLAM_HAVE_ISAL
#include <isa-l/crc.h>
#include <isa-l/igzip_lib.h>
#else
#include <libdeflate.h>
#endif

#include <array>
#include <limits>
#include <new>
#include <vector>

namespace dynslam::runtime {
namespace {

/// What a stream that is too long may have at most [bytes].
std::size_t largest(std::size_t expected) {
  return 2 * expected + (std::size_t{1} << 20);
}

}  // namespace

#ifdef DYNSLAM_HAVE_ISAL

struct ZlibInflater::State {
  inflate_state stream;
};

Inflated ZlibInflater::operator()(std::span<const std::span<const std::uint8_t>> parts,
                                  std::span<std::uint8_t> out) {
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (largest(out.size()) > kMost) return Inflated::too_long;  // for its counters
  inflate_state& s = state_->stream;
  isal_inflate_init(&s);
  s.crc_flag = ISAL_ZLIB;
  s.next_out = out.data();
  s.avail_out = static_cast<std::uint32_t>(out.size());
  // The last bytes of a stream may be asked for once there is no place; and what there is too much is read,
  // for its check sum tells surplus from damage.
  std::array<std::uint8_t, 1024> beyond;
  const auto finished = [&] { return s.block_state == ISAL_BLOCK_FINISH; };
  for (std::size_t k = 0; k < parts.size() && !finished(); ++k) {
    if (parts[k].size() > kMost) return Inflated::broken;
    s.next_in = const_cast<std::uint8_t*>(parts[k].data());  // it is only read
    s.avail_in = static_cast<std::uint32_t>(parts[k].size());
    bool goes_on = true;
    while (goes_on && !finished()) {
      if (s.avail_out == 0) {
        s.next_out = beyond.data();
        s.avail_out = static_cast<std::uint32_t>(beyond.size());
      }
      const std::uint32_t in = s.avail_in, room = s.avail_out;
      const int result = isal_inflate(&s);
      if (result < 0 || result == ISAL_NEED_DICT || s.total_out > largest(out.size()))
        return Inflated::broken;
      goes_on = s.avail_in != in || s.avail_out != room;  // otherwise the next part is wanted
    }
  }
  if (!finished()) return Inflated::broken;
  return s.total_out == out.size()  ? Inflated::whole
         : s.total_out > out.size() ? Inflated::too_long
                                    : Inflated::too_short;
}

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  return crc32_gzip_refl(0, bytes.data(), bytes.size());
}

#else

struct ZlibInflater::State {
  struct Free {
    void operator()(libdeflate_decompressor* d) const { libdeflate_free_decompressor(d); }
  };
  std::unique_ptr<libdeflate_decompressor, Free> decompressor{libdeflate_alloc_decompressor()};
  std::vector<std::uint8_t> joined;
};

Inflated ZlibInflater::operator()(std::span<const std::span<const std::uint8_t>> parts,
                                  std::span<std::uint8_t> out) {
  if (!state_->decompressor) throw std::bad_alloc();
  std::span<const std::uint8_t> stream = parts.empty() ? std::span<const std::uint8_t>() : parts.front();
  if (parts.size() > 1) {
    state_->joined.clear();
    for (const auto& part : parts) state_->joined.insert(state_->joined.end(), part.begin(), part.end());
    stream = state_->joined;
  }
  std::size_t length = 0;
  const auto decompress = [&](std::span<std::uint8_t> to) {
    return libdeflate_zlib_decompress(state_->decompressor.get(), stream.data(), stream.size(), to.data(),
                                      to.size(), &length);
  };
  switch (decompress(out)) {
    case LIBDEFLATE_SUCCESS:
      return length == out.size() ? Inflated::whole : Inflated::too_short;
    case LIBDEFLATE_INSUFFICIENT_SPACE: {
      // What there is too much is read, for its check sum tells surplus from damage.
      std::vector<std::uint8_t> all(largest(out.size()));
      return decompress(all) == LIBDEFLATE_SUCCESS ? Inflated::too_long : Inflated::broken;
    }
    default:
      return Inflated::broken;
  }
}

std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
  return libdeflate_crc32(0, bytes.data(), bytes.size());
}

#endif

ZlibInflater::ZlibInflater() : state_(std::make_unique<State>()) {}
ZlibInflater::~ZlibInflater() = default;

}  // namespace dynslam::runtime
