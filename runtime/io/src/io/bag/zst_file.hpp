// SPDX-License-Identifier: BSD-3-Clause
// Files compressed by zstd, as rosbag2 leaves them with --compression-mode file: FILE.mcap.zst, FILE.db3.zst.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace dynslam::runtime::bag {

/// Whether a file begins as zstd's do.
[[nodiscard]] bool is_zst(const std::filesystem::path& path);

/// The first bytes, at most `most`, of what is compressed; fewer where it cannot be decompressed.
[[nodiscard]] std::string start_of_zst(const std::filesystem::path& path, std::size_t most);

/// A temporary file (in TMPDIR) with what is compressed in another; it goes when this does, at the latest.
class UnpackedZst {
 public:
  /// @throws InputError: damaged, no space, or dynslam was built without zstd
  explicit UnpackedZst(const std::filesystem::path& path);
  ~UnpackedZst();
  UnpackedZst(const UnpackedZst&) = delete;
  UnpackedZst& operator=(const UnpackedZst&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] bool cut_off() const { return cut_off_; }  ///< the compressed file ends too early

 private:
  void fill(const std::filesystem::path& packed, int file);

  std::filesystem::path path_;
  bool cut_off_ = false;
};

}  // namespace dynslam::runtime::bag
