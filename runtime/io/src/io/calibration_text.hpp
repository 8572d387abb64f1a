// SPDX-License-Identifier: BSD-3-Clause
// What of YAML and XML calibrations are written in. Internal to the runtime.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace dynslam::runtime {

/// A name of a file with its words: "camera_matrix.data" and nine numbers, say. Words are without quotes.
struct NamedWords {
  std::string name;  ///< names around it and its own, joined by dots
  std::vector<std::string> words;
  std::size_t line = 0;  ///< 1-based
};

/// `key: value` lines, nested by indentation; a value is one word, [words, in, brackets] over any number of
/// lines, or a list of `- word` lines. Comments, tags (!!opencv-matrix) and directives (%YAML, ---) are left
/// out; of several documents the first counts. That is what ROS' camera_info and cv::FileStorage write, not
/// the whole of YAML. @throws InputError (line)
[[nodiscard]] std::vector<NamedWords> parse_yaml(const std::string& text, const std::string& file);

/// The elements of cv::FileStorage's XML within <opencv_storage>; attributes are left out.
/// @throws InputError (line)
[[nodiscard]] std::vector<NamedWords> parse_xml(const std::string& text, const std::string& file);

}  // namespace dynslam::runtime
