// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <istream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dynslam::runtime {

/// A text without the blanks, tabs and carriage returns around it.
[[nodiscard]] std::string_view trim(std::string_view text);

/// A text without the quotes around it, single or double, where it has both.
[[nodiscard]] std::string_view unquoted(std::string_view text);
/// Text without the comment at its end: # at its start or behind a blank, outside quotes.
[[nodiscard]] std::string_view without_comment(std::string_view text);

/// The words of a line; commas and tabs separate as blanks do (as in TUM's tools).
[[nodiscard]] std::vector<std::string_view> split_words(std::string_view line);

/// A finite number that fills the whole word; nullopt otherwise.
[[nodiscard]] std::optional<double> parse_number(std::string_view word);

/// Whether a text has control characters: line breaks, tabs, escapes. A name that goes into lines has none.
[[nodiscard]] bool has_control(std::string_view text);
/// The text on one line that no terminal obeys: control characters as `\\x` and two digits.
[[nodiscard]] std::string printable(std::string_view text);

/// A text without the byte order mark of UTF-8 before it.
[[nodiscard]] std::string_view without_mark(std::string_view text);
/// The same of a file's whole text. @throws InputError naming the file, for UTF-16 and UTF-32
[[nodiscard]] std::string as_utf8(std::string text, const std::string& name);

/// Reads a text file line by line, skipping blank lines, comments (#) and a byte order mark.
class LineReader {
 public:
  explicit LineReader(std::istream& in) : in_(in) {}
  /// Next line with content; false at the end.
  bool next();
  [[nodiscard]] const std::string& line() const { return line_; }
  [[nodiscard]] std::size_t number() const { return number_; }  ///< 1-based

 private:
  std::istream& in_;
  std::string line_;
  std::size_t number_ = 0;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
