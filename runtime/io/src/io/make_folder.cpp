// SPDX-License-Identifier: BSD-3-Clause
#include "io/make_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"

namespace dynslam::runtime {

namespace fs = std::filesystem;

void make_folder(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path))
    throw InputError(path.string(), 0, "cannot be made a folder: " + error.message());
}

FileHandle lock_folder(const fs::path& path) {
  FileHandle folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder && ::flock(folder.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw InputError(path.string(), 0,
                     "is where another process writes its results now: choose another folder");
  return folder;
}

void begin_sequence(const fs::path& out, std::span<const char* const> image_folders) {
  write_file(out / kUnfinished, "This sequence was not finished; the same command begins it anew.\n");
  for (const char* file : kSequenceFiles) fs::remove(out / file);
  for (const char* images : image_folders) {
    make_folder(out / images);
    for (const auto& file : fs::directory_iterator(out / images)) {
      if (file.path().extension() == ".png") fs::remove(file.path());
    }
  }
}

void check_is_folder(const fs::path& path) {
  if (fs::is_directory(path)) return;
  std::error_code error;
  throw InputError(path.string(), 0, fs::exists(path, error) ? "is not a folder" : "does not exist");
}

bool lies_in(const fs::path& inner, const fs::path& outer) {
  const auto clean = [](const fs::path& path) {
    const fs::path full = fs::weakly_canonical(fs::absolute(path));
    return full.has_filename() ? full : full.parent_path();
  };
  const fs::path a = clean(inner), b = clean(outer);
  return std::mismatch(a.begin(), a.end(), b.begin(), b.end()).second == b.end();
}

}  // namespace dynslam::runtime
