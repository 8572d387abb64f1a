// SPDX-License-Identifier: BSD-3-Clause
// Folders that change as a whole.
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string_view>

#include "io/file_handle.hpp"

namespace dynslam::runtime {

/// Names of the files that a folder of this program holds, the one that it cannot be without first.
/// Everything else in it is the user's.
using FolderNames = std::span<const std::string_view>;

/// A folder that others see whole or not at all. Its files are written into a folder of its own beside it
/// (NAME.<process>-<random>-<count>.partial), which takes its place in publish(). Without publish() the draft
/// is removed.
///
/// publish() exchanges the two folders by one system call, renameat2(RENAME_EXCHANGE). Where the file system
/// has none (NFS, FAT) the old folder steps aside as NAME.<...>.old first; a process that is killed between
/// these two steps leaves no NAME, until restore_folder() puts the old one back.
///
/// Only files of the names given, and their temporaries, are ever deleted. What else the old folder holds is
/// in the new one, too: files as further links before the exchange, so that they are never missing; folders,
/// and files where the file system has no such links, right after it.
class FolderDraft {
 public:
  /// @param target  the folder; a link is followed. @throws InputError naming it: a link to nothing, a mount
  /// point,
  ///        or no draft can be made beside it
  FolderDraft(const std::filesystem::path& target, FolderNames names);
  ~FolderDraft();
  FolderDraft(const FolderDraft&) = delete;
  FolderDraft& operator=(const FolderDraft&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Brings everything to the disk and the folder to its name. Call it once. @throws InputError: the folder
  /// is what it was, and the message names where the draft is kept
  void publish();

 private:
  void link_foreign() const;
  /// Replaces the folder in two steps. @return 0 or the error
  int step_aside();

  FolderNames names_;
  std::filesystem::path target_, path_;
  std::filesystem::path old_;  // where the old folder is after publishing; empty: there was none
  FileHandle lock_;            // held as long as the draft is in use
  bool keep_ = false;
};

/// Puts a folder back that a killed publish() moved aside. @return whether there is one now
bool restore_folder(const std::filesystem::path& target, FolderNames names);

/// Reads several files of a folder that another process may replace as a whole meanwhile: where it has, what
/// `read` throws for files that do not belong together is no fault of theirs, and it is called again.
/// @throws what `read` throws of a folder that stays
void read_unchanged(const std::filesystem::path& folder, const std::function<void()>& read);

/// Removes what killed drafts of a folder left beside it; what of it is the user's goes into the folder.
/// Nothing is done while there is no folder, to drafts of processes that live, and to other names.
void clear_leftovers(const std::filesystem::path& target, FolderNames names);

}  // namespace dynslam::runtime
