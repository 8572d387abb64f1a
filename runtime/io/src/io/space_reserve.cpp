// SPDX-License-Identifier: BSD-3-Clause
#include "io/space_reserve.hpp"

#include <fcntl.h>
#include <fmt/format.h>

#include <cerrno>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"

namespace dynslam::runtime {

SpaceReserve::SpaceReserve(const std::filesystem::path& folder, std::uint64_t bytes)
    : file_(::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600)) {
  if (!file_) {  // a file system without nameless files
    const auto name = unused_name_beside(folder / "reserve", "tmp");
    file_ = FileHandle(::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (file_) ::unlink(name.c_str());
  }
  const int error = file_ ? ::posix_fallocate(file_.get(), 0, static_cast<off_t>(bytes)) : errno;
  if (error == ENOSPC || error == EFBIG || error == EDQUOT)
    throw InputError(folder.string(), 0,
                     fmt::format("has no {:.1f} MB free for the results", static_cast<double>(bytes) / 1e6));
  if (error != 0) release();  // it cannot be kept here: what is free then counts
}

}  // namespace dynslam::runtime
