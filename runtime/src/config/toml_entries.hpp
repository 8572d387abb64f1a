// SPDX-License-Identifier: BSD-3-Clause
// Files of TOML, read by toml++ from its headers.
#pragma once

#include <fmt/format.h>

#define TOML_HEADER_ONLY 1
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_FORMATTERS 0
// toml++ 3.3 asserts what a file may break (the name of a table that starts with '&'); with NDEBUG it assumes it.
#define TOML_ASSERT(condition) ((condition) ? void() : ::dynslam::runtime::throw_toml_assertion())
#pragma push_macro("NDEBUG")
#undef NDEBUG
namespace dynslam::runtime {
struct TomlAssertion {};
[[noreturn]] inline void throw_toml_assertion() {
  throw TomlAssertion();
}
}  // namespace dynslam::runtime
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

#include <cmath>
#include <concepts>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/config/options_file.hpp"

namespace dynslam::runtime {

/// A table, or a key with its value.
struct TomlEntry {
  std::string table, key;             ///< "tracker.search", "min_inliers"; the key empty: the table begins
  const toml::node* value = nullptr;  ///< none where a table begins
  std::size_t line = 0;               ///< 1-based
};
struct TomlFile {
  toml::table root;
  /// In the order of the file. A table that holds tables alone is named by these.
  std::vector<TomlEntry> entries;
};

/// Beside TOML, a value that is none, as in `dynamics = none`, counts as text.
/// @throws InputError (file, line)
[[nodiscard]] TomlFile read_toml(std::string text, const std::string& file);

/// As set_config of options_file.hpp.
[[nodiscard]] std::string set_config(ConfigField& field, const toml::node& value);

/// A value as it stands in a file.
[[nodiscard]] std::string toml_text(const toml::node& value);
[[nodiscard]] std::string toml_text(std::string_view value);
/// The shortest digits that give the same value again, with a mark of a floating-point number.
template <std::floating_point T>
[[nodiscard]] std::string toml_text(T value) {
  std::string text = fmt::format("{}", value);
  if (std::isfinite(value) && text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}
/// The same, of text without quotes.
[[nodiscard]] std::string toml_word(const toml::node& value);

}  // namespace dynslam::runtime
