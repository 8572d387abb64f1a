// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/read_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/file_handle.hpp"

namespace dynslam::runtime {

std::string read_file(const std::filesystem::path& path, std::uint64_t limit) {
  const auto refuse = [&](const std::string& reason) { return InputError(path.string(), 0, reason); };
  const auto system = [](int error) { return std::generic_category().message(error); };
  // Not to wait for a process that writes to a pipe: what is none reads the same.
  const FileHandle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file) throw refuse(errno == ENOENT ? "cannot be opened" : "cannot be opened: " + system(errno));
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) throw refuse("cannot be read: " + system(errno));
  if (S_ISDIR(status.st_mode)) throw refuse("cannot be opened: it is a folder");
  if (!S_ISREG(status.st_mode)) throw refuse("is not a regular file");
  const auto size = static_cast<std::uint64_t>(std::max<off_t>(0, status.st_size));
  const auto too_long = [&] { return refuse(fmt::format("is longer than {} bytes", limit)); };
  if (size > limit) throw too_long();
  std::string content(static_cast<std::size_t>(size) + 1, '\0');  // one more, to see the end
  std::size_t length = 0;
  for (;;) {
    const ::ssize_t got = ::read(file.get(), content.data() + length, content.size() - length);
    if (got == 0) break;
    if (got < 0) {
      if (errno == EINTR) continue;
      throw refuse("cannot be read: " + system(errno));
    }
    length += static_cast<std::size_t>(got);
    if (length > limit) throw too_long();
    if (length == content.size()) content.resize(2 * content.size());  // it grows, or does not tell its size
  }
  content.resize(length);
  return content;
}

std::string read_text(const std::filesystem::path& path, std::uint64_t limit) {
  return as_utf8(read_file(path, limit), path.string());
}

void check_regular_file(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
    throw InputError(path.string(), 0, "is not a regular file");
}

}  // namespace dynslam::runtime
