// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <filesystem>
#include <span>

#include "io/file_handle.hpp"

namespace dynslam::runtime {

/// Makes a folder and those above it where they are missing. @throws InputError naming it
void make_folder(const std::filesystem::path& path);

/// Makes a folder this process' own as long as the handle lives. No file is left there; where the file system
/// knows no locks it is nobody's. @throws InputError where another process has it
[[nodiscard]] FileHandle lock_folder(const std::filesystem::path& path);

/// In a folder whose sequence is not yet whole: load_sequence() refuses it.
inline constexpr const char* kUnfinished = "unfinished.txt";
/// Of a sequence in TUM's layout, beside its images.
inline constexpr std::array kSequenceFiles{"rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt",
                                           "camera.txt"};

/// Makes a folder ready for a sequence: marks it as unfinished and removes what an earlier one left, its
/// files first and then the PNG images. The mark is removed by the caller, when the sequence is whole.
/// @param image_folders  in `out`; made
void begin_sequence(const std::filesystem::path& out, std::span<const char* const> image_folders);

/// @throws InputError  a path that is no folder, or not there
void check_is_folder(const std::filesystem::path& path);

/// Whether a folder is another one or in it; of two folders that need not exist, links followed.
[[nodiscard]] bool lies_in(const std::filesystem::path& inner, const std::filesystem::path& outer);

}  // namespace dynslam::runtime
