// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/byte_source.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime::bag {

FileBytes::FileBytes(const std::filesystem::path& path, std::string name)
    : name_(std::move(name)), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  struct stat status {};
  if (!file_ || ::fstat(file_.get(), &status) != 0)
    throw InputError(name_, 0, fmt::format("cannot be read: {}", std::strerror(errno)));
  if (!S_ISREG(status.st_mode)) throw InputError(name_, 0, "is not a file");
  size_ = static_cast<std::uint64_t>(status.st_size);
}

void FileBytes::read(std::uint64_t at, std::span<std::uint8_t> out) const {
  while (!out.empty()) {
    const ssize_t got = ::pread(file_.get(), out.data(), out.size(), static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw InputError(name_, 0, fmt::format("cannot be read: {}", std::strerror(errno)));
    if (got == 0) throw InputError(name_, 0, fmt::format("ends at byte {}: it was cut off meanwhile", at));
    at += static_cast<std::uint64_t>(got);
    out = out.subspan(static_cast<std::size_t>(got));
  }
}

void MemoryBytes::read(std::uint64_t at, std::span<std::uint8_t> out) const {
  if (at > bytes_.size() || out.size() > bytes_.size() - at)
    throw InputError(name_, 0, fmt::format("ends at byte {}", bytes_.size()));
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), out.size(), out.begin());
}

Cursor::Cursor(const ByteSource& source, std::uint64_t begin, std::uint64_t end)
    : source_(source), at_(begin), end_(end) {
  if (begin > end || end > source.size()) fail("lies beyond the end");
}

void Cursor::fail(const std::string& reason) const {
  throw InputError(source_.name(), 0, fmt::format("at byte {}: {}", at_, reason));
}

void Cursor::need(std::uint64_t size, const char* what) const {
  if (size > left()) fail(fmt::format("{} needs {} bytes, {} are left", what, size, left()));
}

Bytes Cursor::take(std::uint64_t size, const char* what) {
  need(size, what);
  if (at_ < window_at_ || at_ + size > window_at_ + window_.size()) {
    constexpr std::uint64_t kWindow = 1 << 15;
    window_.resize(static_cast<std::size_t>(std::min(std::max(size, kWindow), left())));
    window_at_ = at_;
    source_.read(at_, window_);
  }
  const Bytes found(window_.data() + (at_ - window_at_), static_cast<std::size_t>(size));
  at_ += size;
  return found;
}

void Cursor::skip(std::uint64_t size, const char* what) {
  need(size, what);
  at_ += size;
}

std::uint64_t Cursor::take_number(std::uint64_t size, const char* what) {
  const Bytes bytes = take(size, what);
  std::uint64_t value = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k) value |= static_cast<std::uint64_t>(bytes[k]) << (8 * k);
  return value;
}

}  // namespace dynslam::runtime::bag
