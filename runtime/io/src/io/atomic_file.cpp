// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <random>
#include <streambuf>
#include <system_error>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "io/file_handle.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, int error) {
  throw InputError(path.string(), 0, "cannot be written: " + std::generic_category().message(error));
}

/// Refuses what another file must not take the place of: devices, pipes, folders, links to them, and
/// /dev/stdout, a link to an open file of the process. Another link is replaced itself: its target may be an
/// input.
void check_replaceable(const fs::path& path) {
  check_regular_file(path);
  constexpr int kMostLinks = 40;  // as Linux has it
  std::error_code error;
  fs::path at = path;
  for (int links = 0; links < kMostLinks && fs::is_symlink(at, error); ++links) {
    if (lies_in(at.parent_path() / ".", "/proc")) throw InputError(path.string(), 0, "is not a regular file");
    at = at.parent_path() / fs::read_symlink(at, error);
  }
}

}  // namespace

/// Writes to a file descriptor, which it closes; remembers the first error.
class AtomicFile::Buffer : public std::streambuf {
 public:
  explicit Buffer(int file) : file_(file) { setp(block_.data(), block_.data() + block_.size()); }
  ~Buffer() override { close(); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  /// Writes and closes; 0 or the error.
  int finish(OnDisk when) {
    sync();
    if (when == OnDisk::now && error_ == 0 && ::fsync(file_) != 0 && errno != EINVAL && errno != EROFS)
      error_ = errno;
    close();
    return error_;
  }

 private:
  int overflow(int c) override {
    if (sync() != 0) return traits_type::eof();
    if (c != traits_type::eof()) sputc(static_cast<char>(c));
    return traits_type::not_eof(c);
  }
  int sync() override {
    for (const char* at = pbase(); error_ == 0 && at < pptr();) {
      const auto written = ::write(file_, at, static_cast<std::size_t>(pptr() - at));
      if (written > 0) {
        at += written;
      } else if (errno != EINTR) {
        error_ = errno;
      }
    }
    setp(block_.data(), block_.data() + block_.size());
    return error_ == 0 ? 0 : -1;
  }
  void close() {
    if (file_ >= 0 && ::close(file_) != 0 && error_ == 0) error_ = errno;
    file_ = -1;
  }

  int file_;
  int error_ = 0;
  std::array<char, 1 << 16> block_;
};

AtomicFile::AtomicFile(fs::path path) : path_(std::move(path)), stream_(nullptr) {
  check_replaceable(path_);
  int file = -1;
  do {  // the name was free a moment ago; where another process was faster, another one
    temporary_ = unused_name_beside(path_, "tmp");
    file = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  } while (file < 0 && (errno == EEXIST || errno == EINTR));
  if (file < 0) refuse(path_, errno);
  buffer_ = std::make_unique<Buffer>(file);
  stream_.rdbuf(buffer_.get());
}

AtomicFile::~AtomicFile() {
  if (temporary_.empty()) return;
  stream_.rdbuf(nullptr);
  buffer_.reset();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

void AtomicFile::commit(OnDisk when) {
  const int failure = buffer_->finish(when);
  if (failure != 0 || !stream_) refuse(path_, failure != 0 ? failure : EIO);
  std::error_code error;
  fs::rename(temporary_, path_, error);
  if (error) refuse(path_, error.value());
  temporary_.clear();
  if (when == OnDisk::now) sync_folder(path_.has_parent_path() ? path_.parent_path() : fs::path("."));
}

void sync_folder(const fs::path& folder) {
  const FileHandle handle(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (handle) ::fsync(handle.get());  // what fails here is written all the same
}

void write_file(const fs::path& path, std::string_view content) {
  AtomicFile file(path);
  file.stream() << content;
  file.commit();
}

fs::path unused_name_beside(const fs::path& path, std::string_view suffix) {
  // The process and a counter tell apart whoever shares this machine; the random number, whoever shares the
  // disk.
  static std::atomic<unsigned> count{0};
  static const unsigned random = std::random_device{}();
  const fs::path clean = path.has_filename() ? path : path.parent_path();
  for (;;) {
    fs::path name = clean;
    name += fmt::format(".{}-{:08x}-{}.{}", ::getpid(), random, count++, suffix);
    std::error_code ignored;
    if (!fs::exists(fs::symlink_status(name, ignored))) return name;
  }
}

}  // namespace dynslam::runtime
