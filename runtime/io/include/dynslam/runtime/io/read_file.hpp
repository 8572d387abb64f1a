// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <filesystem>
#include <string>

namespace dynslam::runtime {

/// Longest file that read_file() takes unless it is told another limit [bytes]: a list of three million
/// frames, an image of 8192 x 8192 pixels that does not compress.
inline constexpr std::uint64_t kReadLimit = std::uint64_t(1) << 28;

/// The whole content of a regular file. A pipe, a device or a folder is refused, never waited for.
/// @param limit  bytes; a longer file is refused
/// @throws InputError naming the file, with the system's reason; also where reading ends by an error, which a
///         stream takes for the end of the file
[[nodiscard]] std::string read_file(const std::filesystem::path& path, std::uint64_t limit = kReadLimit);

/// The text of a regular file, without the byte order mark that Windows' editors put before it.
/// @throws InputError as read_file(), and for UTF-16 and UTF-32, which no reader of this library takes
[[nodiscard]] std::string read_text(const std::filesystem::path& path, std::uint64_t limit = kReadLimit);

/// Refuses what is there and no regular file, for those who read by a stream. @throws InputError naming it
void check_regular_file(const std::filesystem::path& path);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
