// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/zst_file.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <span>
#include <system_error>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_chunk.hpp"
#include "io/bag/byte_source.hpp"
#include "io/file_handle.hpp"
#ifdef DYNSLAM_HAVE_ZSTD
#include <zstd.h>
#endif

namespace dynslam::runtime::bag {
namespace {

namespace fs = std::filesystem;

#ifdef DYNSLAM_HAVE_ZSTD
/// Decompresses a file from its beginning, piece by piece.
class ZstReader {
 public:
  explicit ZstReader(const fs::path& path) : file_(path), stream_(ZSTD_createDStream(), &ZSTD_freeDStream) {}

  /// Fills as much of `out` as there is. @throws InputError for what is damaged
  std::size_t read(std::span<std::uint8_t> out) {
    ZSTD_outBuffer part{out.data(), out.size(), 0};
    while (part.pos < part.size) {
      if (in_.pos == in_.size && !refill()) {
        // What is left in the stream comes out without further input.
        const std::size_t before = part.pos;
        if (hint_ != 0) decompress(part);
        if (part.pos == before) break;
      } else {
        decompress(part);
      }
    }
    return part.pos;
  }
  /// Whether the file ended amid a frame.
  [[nodiscard]] bool cut_off() const { return hint_ != 0; }

 private:
  bool refill() {
    constexpr std::uint64_t kBlock = 1 << 20;
    block_.resize(static_cast<std::size_t>(std::min(kBlock, file_.size() - at_)));
    file_.read(at_, block_);
    at_ += block_.size();
    in_ = {block_.data(), block_.size(), 0};
    return !block_.empty();
  }
  void decompress(ZSTD_outBuffer& part) {
    hint_ = ZSTD_decompressStream(stream_.get(), &part, &in_);
    if (ZSTD_isError(hint_) != 0)
      throw InputError(file_.name(), 0, fmt::format("is damaged: zstd says '{}'", ZSTD_getErrorName(hint_)));
  }

  FileBytes file_;
  std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream_;
  std::vector<std::uint8_t> block_;
  std::uint64_t at_ = 0;
  ZSTD_inBuffer in_{nullptr, 0, 0};
  std::size_t hint_ = 1;  // 0: at the end of a frame
};
#endif

[[noreturn]] void refuse_to_unpack(const fs::path& packed, const fs::path& folder, int error) {
  throw InputError(packed.string(), 0,
                   fmt::format("cannot be decompressed into {}: {}; zstd -d FILE does it elsewhere, TMPDIR "
                               "names another folder",
                               folder.string(), std::generic_category().message(error)));
}

}  // namespace

bool is_zst(const fs::path& path) {
  constexpr std::array<char, 4> kMagic{'\x28', '\xB5', '\x2F', '\xFD'};
  std::array<char, 4> start{};
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  std::ifstream in(path, std::ios::binary);
  return in.read(start.data(), start.size()) && start == kMagic;
}

UnpackedZst::UnpackedZst(const fs::path& path) {
  require_decompression("zstd", path.string());
  const char* set = std::getenv("TMPDIR");
  const fs::path folder = set != nullptr && *set != '\0' ? set : "/tmp";
  std::string name = (folder / "dynslam-XXXXXX").string();
  const FileHandle file(::mkstemp(name.data()));
  if (!file) refuse_to_unpack(path, folder, errno);
  path_ = name;
  try {
    fill(path, file.get());
  } catch (...) {
    ::unlink(path_.c_str());
    throw;
  }
}

UnpackedZst::~UnpackedZst() {
  ::unlink(path_.c_str());
}

#ifdef DYNSLAM_HAVE_ZSTD
std::string start_of_zst(const fs::path& path, std::size_t most) try {
  std::string start(most, '\0');
  start.resize(ZstReader(path).read({reinterpret_cast<std::uint8_t*>(start.data()), most}));
  return start;
} catch (const InputError&) {
  return {};
}

void UnpackedZst::fill(const fs::path& packed, int file) {
  ZstReader reader(packed);
  std::vector<std::uint8_t> block(1 << 20);
  std::size_t got = 0;
  do {
    // A small file may be terabytes when decompressed, and others need the disk, too.
    constexpr std::uintmax_t kLeft = 256 << 20;
    std::error_code error;
    const fs::space_info space = fs::space(path_, error);
    if (!error && space.available < kLeft) refuse_to_unpack(packed, path_.parent_path(), ENOSPC);
    got = reader.read(block);
    for (std::span<const std::uint8_t> rest = std::span(block).first(got); !rest.empty();) {
      const ssize_t written = ::write(file, rest.data(), rest.size());
      if (written < 0 && errno != EINTR) refuse_to_unpack(packed, path_.parent_path(), errno);
      if (written > 0) rest = rest.subspan(static_cast<std::size_t>(written));
    }
  } while (got == block.size());
  cut_off_ = reader.cut_off();
}
#else
std::string start_of_zst(const fs::path&, std::size_t) {
  return {};
}
void UnpackedZst::fill(const fs::path&, int) {}
#endif

}  // namespace dynslam::runtime::bag
