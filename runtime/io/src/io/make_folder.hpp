// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "io/file_handle.hpp"

namespace dynslam::runtime {

/// Makes a folder and those above it where they are missing. @throws InputError naming it
void make_folder(const std::filesystem::path& path);

/// Makes a folder this process' own as long as the handle lives. No file is left there; where the file system
/// knows no locks it is nobody's. @throws InputError where another process has it
[[nodiscard]] FileHandle lock_folder(const std::filesystem::path& path);

/// @throws InputError  a path that is no folder, or not there
void check_is_folder(const std::filesystem::path& path);

/// Whether a folder is another one or in it; of two folders that need not exist, links followed.
[[nodiscard]] bool lies_in(const std::filesystem::path& inner, const std::filesystem::path& outer);

}  // namespace dynslam::runtime
