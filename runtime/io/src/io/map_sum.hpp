// SPDX-License-Identifier: BSD-3-Clause
// The check sum of a map's file: 16 bytes behind the tree, where OctoMap's reader does not look.
#pragma once

#include <filesystem>
#include <functional>
#include <istream>
#include <ostream>

namespace dynslam::runtime {

/// Writes what `write` writes, and its check sum behind it.
void write_summed(std::ostream& out, const std::function<void(std::ostream&)>& write);

/// Compares the check sum at the end of a file with its bytes, and goes back to the beginning.
/// @return  length of the check sum in bytes; 0: the file has none (dynslam 0.1.0)
/// @throws InputError naming `path` where the two differ
[[nodiscard]] std::size_t check_sum_of(std::istream& in, const std::filesystem::path& path);

}  // namespace dynslam::runtime
