// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace dynslam::runtime {

/// A number as it was written, without underscores: who takes it knows of what type it is to be.
struct TomlNumber {
  std::string digits;
};

/// A value of TOML that stands on one line: dates, tables within a line and strings of several lines are
/// none.
struct TomlValue;
using TomlArray = std::vector<TomlValue>;
struct TomlValue {
  std::variant<bool, TomlNumber, std::string, TomlArray> value;
};

/// Reads a value and what may follow it, blanks and a comment. @return what is wrong; empty: nothing
[[nodiscard]] std::string parse_toml(std::string_view text, TomlValue& result);

/// A string in quotes.
[[nodiscard]] std::string toml_string(std::string_view text);

}  // namespace dynslam::runtime
