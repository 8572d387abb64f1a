// SPDX-License-Identifier: BSD-3-Clause
#include "io/folder_draft.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <string>
#include <system_error>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, const std::string& what, int error) {
  throw InputError(path.string(), 0, what + ": " + std::generic_category().message(error));
}

/// The folder itself where the path is a link to it.
fs::path followed(const fs::path& path) {
  fs::path clean = path.has_filename() ? path : path.parent_path();
  std::error_code error;
  if (clean.filename() == "." || clean.filename() == "..") clean = fs::weakly_canonical(clean, error);
  if (!fs::is_symlink(clean, error)) return clean;
  fs::path real = fs::canonical(clean, error);
  if (error) throw InputError(clean.string(), 0, "is a link to a place that does not exist");
  return real;
}

fs::path parent_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

bool same_file(const fs::path& a, const fs::path& b) {
  struct stat x {
  }, y{};
  return ::lstat(a.c_str(), &x) == 0 && ::lstat(b.c_str(), &y) == 0 && x.st_dev == y.st_dev &&
         x.st_ino == y.st_ino;
}

/// The process of a name that unused_name_beside() made of `base`; 0: it is another name.
/// @param suffix  behind the last dot
pid_t maker_of(std::string_view name, std::string_view base, std::string_view suffix) {
  if (!name.starts_with(base) || !name.ends_with(suffix)) return 0;
  name.remove_prefix(base.size());
  name.remove_suffix(suffix.size());
  if (name.size() < 2 || name.front() != '.' || name.back() != '.') return 0;
  name = name.substr(1, name.size() - 2);
  const auto digits = [](std::string_view text, std::string_view allowed) {
    return !text.empty() && text.find_first_not_of(allowed) == std::string_view::npos;
  };
  const auto first = name.find('-'), last = name.rfind('-');
  if (first == std::string_view::npos || last == first) return 0;
  const std::string_view process = name.substr(0, first);
  if (!digits(process, "0123456789") || last - first != 9 ||
      !digits(name.substr(first + 1, 8), "0123456789abcdef") || !digits(name.substr(last + 1), "0123456789"))
    return 0;
  pid_t maker = 0;
  std::from_chars(process.data(), process.data() + process.size(), maker);
  return maker;
}

/// Whether this program made a file of that name: one of `names`, or a temporary of one (AtomicFile).
bool own(const fs::path& name, FolderNames names) {
  return std::any_of(names.begin(), names.end(), [&](std::string_view known) {
    return name.native() == known || maker_of(name.native(), known, "tmp") != 0;
  });
}

FileHandle lock_of(const fs::path& folder) {
  FileHandle handle(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (handle && ::flock(handle.get(), LOCK_EX | LOCK_NB) != 0) return {};
  return handle;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    found.push_back(it->path());
  return found;
}

/// Folders beside `target` that a process left which does not live any more.
std::vector<fs::path> leftovers(const fs::path& target, std::string_view suffix) {
  std::vector<fs::path> found;
  for (const fs::path& path : entries(parent_of(target))) {
    const pid_t maker = maker_of(path.filename().native(), target.filename().native(), suffix);
    std::error_code error;
    if (maker == 0 || !fs::is_directory(fs::symlink_status(path, error))) continue;
    if (::kill(maker, 0) == 0 || errno == EPERM) continue;
    if (lock_of(path)) found.push_back(path);  // nor lives on another machine
  }
  return found;
}

/// Moves `from` to a name that nothing has. @return whether it is there now
bool move_to_free_name(const fs::path& from, const fs::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return true;
  std::error_code error;
  if (errno == EEXIST || fs::exists(fs::symlink_status(to, error))) return false;
  fs::rename(from, to, error);  // of a file system that knows no flags
  return !error;
}

/// Removes a folder that `target` has replaced: its own files go, the user's move into `target`.
void dissolve(const fs::path& folder, const fs::path& target, FolderNames names) {
  for (const fs::path& path : entries(folder)) {
    const fs::path name = path.filename();
    if (own(name, names) || (!move_to_free_name(path, target / name) && same_file(path, target / name)))
      ::unlink(path.c_str());
  }
  ::rmdir(folder.c_str());  // stays where something is left that nobody else has
}

bool lacks_exchange(int error) {
  return error == ENOSYS || error == EINVAL || error == EOPNOTSUPP || error == ENOTSUP || error == EPERM;
}

}  // namespace

FolderDraft::FolderDraft(const fs::path& target, FolderNames names)
    : names_(names), target_(followed(target)), path_(unused_name_beside(target_, "partial")) {
  std::error_code error;
  if (same_file(target_, "."))
    throw InputError(target.string(), 0,
                     "is the folder that the program runs in, which cannot be replaced: give a folder in it");
  fs::create_directories(parent_of(target_), error);
  struct stat folder {
  }, parent{};
  const bool there = !error && ::stat(target_.c_str(), &folder) == 0;
  if (there && ::stat(parent_of(target_).c_str(), &parent) == 0 && folder.st_dev != parent.st_dev)
    throw InputError(target.string(), 0, "is a mount point, which cannot be replaced: give a folder in it");
  if (!error) fs::create_directory(path_, error);
  if (!error && there) ::chmod(path_.c_str(), folder.st_mode & 07777U);
  if (error) throw InputError(target.string(), 0, "cannot be made a folder: " + error.message());
  lock_ = lock_of(path_);
}

FolderDraft::~FolderDraft() {
  if (path_.empty() || keep_) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);  // nobody but this object wrote there
}

void FolderDraft::publish() {
  sync_folder(path_);
  const auto failed = [&](int error) {
    // Under a name that is not taken for a leftover: it may be all that there is of a day's work.
    const fs::path kept = unused_name_beside(target_, "unsaved");
    if (::rename(path_.c_str(), kept.c_str()) == 0) path_ = kept;
    keep_ = true;
    refuse(target_, "cannot be replaced, what was to be saved is in " + path_.string(), error);
  };
  if (::rename(path_.c_str(), target_.c_str()) == 0) {  // there was none, or an empty one
    path_.clear();
    sync_folder(parent_of(target_));
    return;
  }
  if (errno != ENOTEMPTY && errno != EEXIST) failed(errno);
  link_foreign();
  sync_folder(path_);
  if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, target_.c_str(), RENAME_EXCHANGE) == 0) {
    old_ = path_;
  } else if (!lacks_exchange(errno)) {
    failed(errno);
  } else if (const int error = step_aside(); error != 0) {
    failed(error);
  }
  path_.clear();
  sync_folder(parent_of(target_));
  dissolve(old_, target_, names_);
}

int FolderDraft::step_aside() {
  const FileHandle lock = lock_of(target_);  // lets nobody put it back meanwhile
  old_ = unused_name_beside(target_, "old");
  if (::rename(target_.c_str(), old_.c_str()) != 0) return errno;
  if (::rename(path_.c_str(), target_.c_str()) == 0) return 0;
  const int error = errno;
  ::rename(old_.c_str(), target_.c_str());
  return error;
}

void FolderDraft::link_foreign() const {
  for (const fs::path& path : entries(target_)) {
    if (!own(path.filename(), names_)) (void)::link(path.c_str(), (path_ / path.filename()).c_str());
  }
}

bool restore_folder(const fs::path& target, FolderNames names) {
  std::error_code error;
  const fs::path folder = followed(target);
  if (fs::exists(folder, error)) return true;
  for (const fs::path& old : leftovers(folder, "old")) {
    if (!fs::exists(old / names.front(), error)) continue;
    fs::rename(old, folder, error);
    if (!error) return true;
  }
  return false;
}

void read_unchanged(const fs::path& folder, const std::function<void()>& read) {
  const auto state = [&] {
    struct stat found {};
    const bool there = ::stat(folder.c_str(), &found) == 0;
    return there ? std::array<std::int64_t, 4>{static_cast<std::int64_t>(found.st_dev),
                                               static_cast<std::int64_t>(found.st_ino), found.st_ctim.tv_sec,
                                               found.st_ctim.tv_nsec}
                 : std::array<std::int64_t, 4>{};
  };
  constexpr int kMost = 20;  // one save after the other, all this time
  for (int time = 1;; ++time) {
    const auto before = state();
    try {
      return read();
    } catch (const InputError&) {
      if (time == kMost || state() == before) throw;
    }
  }
}

void clear_leftovers(const fs::path& target, FolderNames names) {
  std::error_code error;
  const fs::path folder = followed(target);
  if (!fs::exists(folder / names.front(), error)) return;
  for (const char* suffix : {"partial", "old"}) {
    for (const fs::path& path : leftovers(folder, suffix)) dissolve(path, folder, names);
  }
}

}  // namespace dynslam::runtime
