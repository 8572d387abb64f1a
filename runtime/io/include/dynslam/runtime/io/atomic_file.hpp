// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <filesystem>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>

namespace dynslam::runtime {

/// When what commit() gives a name to is on the disk: by the time it returns, or when the system writes it. A
/// killed program loses nothing either way; a machine without power may.
enum class OnDisk { now, eventually };

/// A file that others see whole or not at all: what is written goes to a temporary file beside it, which
/// takes its place in commit(). The temporary has a name that no other process or thread uses and is never
/// opened through a link, so several writers of one file disturb neither each other nor a reader; the last
/// one counts. Without commit() the temporary is removed and the file stays as it was. A link is replaced
/// itself, and the file that it leads to stays.
class AtomicFile {
 public:
  /// @throws InputError naming `path`: it is there and no regular file (a device, pipe or folder is never
  /// replaced), or the system's reason
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  [[nodiscard]] std::ostream& stream() { return stream_; }
  /// Brings everything to the disk and the file to its name. Call it once. @throws InputError like the
  /// constructor
  void commit(OnDisk when = OnDisk::now);

 private:
  class Buffer;
  std::filesystem::path path_, temporary_;
  std::unique_ptr<Buffer> buffer_;
  std::ostream stream_;
};

/// Writes a whole file through AtomicFile. @throws InputError
void write_file(const std::filesystem::path& path, std::string_view content);

/// Brings the names in a folder to the disk, as far as its file system does that.
void sync_folder(const std::filesystem::path& folder);

/// `PATH.<something>.<suffix>` that nothing has, for a temporary file or folder beside `path`.
[[nodiscard]] std::filesystem::path unused_name_beside(const std::filesystem::path& path,
                                                       std::string_view suffix);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
