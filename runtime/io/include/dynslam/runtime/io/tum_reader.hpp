// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <istream>
#include <string>
#include <vector>

#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/sequence.hpp"

namespace dynslam::runtime {

/// A line of rgb.txt or depth.txt.
struct ListEntry {
  double t;
  std::string stamp, path;
  std::int64_t ns{};  ///< as FrameRecord has it
};
/// Reads "timestamp path" lines. @throws InputError with the line: malformed, or stamps not increasing
[[nodiscard]] std::vector<ListEntry> parse_list(std::istream& in, const std::string& name);
/// Reads "rgb_stamp rgb_path depth_stamp depth_path" lines; the two images may change places where the paths
/// say which one is depth. @throws InputError like parse_list
[[nodiscard]] std::vector<FrameRecord> parse_associations(std::istream& in, const std::string& name);
/// The same of lists in any order: they are sorted by time, and of a time that comes once more the first line
/// counts. @param notes  takes what was mended, a line each
[[nodiscard]] std::vector<ListEntry> parse_unsorted_list(std::istream& in, const std::string& name,
                                                         std::vector<std::string>& notes);
/// By the colour images' times.
[[nodiscard]] std::vector<FrameRecord> parse_unsorted_associations(std::istream& in, const std::string& name,
                                                                   std::vector<std::string>& notes);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
