// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>

#include "io/file_handle.hpp"

namespace dynslam::runtime {

/// Space on a disk that is kept free of others' files until it is needed for ours. It has no name: nothing is
/// left of it when the process ends, however it ends.
class SpaceReserve {
 public:
  /// @throws InputError naming the folder where there is not so much space
  SpaceReserve(const std::filesystem::path& folder, std::uint64_t bytes);
  void release() { file_ = FileHandle(); }

 private:
  FileHandle file_;
};

}  // namespace dynslam::runtime
