// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "dynslam/runtime/config/run_options.hpp"

namespace dynslam::runtime {

/// Numbers that a field may take; all are finite.
struct ConfigRange {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool above = false;  ///< `low` itself is too low
  [[nodiscard]] bool holds(double value) const;
  [[nodiscard]] std::string text() const;  ///< "0 to 1", "1 or more", "above 0"; empty: any number
};

/// An enumeration by its names.
struct ConfigChoice {
  const void* object = nullptr;
  std::vector<std::string> names;
  std::function<std::string()> get;
  std::function<void(std::string_view)> set;  ///< takes one of the names
};

/// Where a field's value is.
using ConfigValue = std::variant<bool*, int*, std::uint64_t*, float*, double*, std::string*,
                                 std::filesystem::path*, std::vector<std::string>*, std::span<double>,
                                 cv::Size*, std::optional<double>*, ConfigChoice>;

/// A field of the options, as it stands in a configuration file.
struct ConfigField {
  std::string table, key;     ///< "tracker.search", "min_inliers"
  std::string unit, meaning;  ///< unit: empty for plain numbers and words
  ConfigRange range;          ///< of numbers
  ConfigValue value;
  bool tuning = false;  ///< a threshold that may change or go in any version; the others are user fields
  [[nodiscard]] std::string name() const { return table + '.' + key; }
};
/// The fields of a configuration, in the order of its file.
using ConfigFields = std::vector<ConfigField>;

/// Every field of a run's options that has an effect, in the order of the file. Not among them: the sequence,
/// the folders that are written (`out`, `save_map`), and fields that take over another one's value, which
/// src/config/ names.
/// @param options, dynamics  must live as long as the fields. `dynamics` stands for that of the options;
///                           empty: by what masks there are
[[nodiscard]] ConfigFields config_fields(RunOptions& options, std::optional<DynamicsMode>& dynamics);

/// A field's value as TOML. Numbers have as many digits as give the same value when they are read again.
[[nodiscard]] std::string config_text(const ConfigField& field);

/// A configuration file: every user field, and each tuning field that has not its default, under its table
/// with meaning, unit and range as a comment. Fields that are not in it have their defaults.
[[nodiscard]] std::string config_file(const ConfigFields& fields);

/// A file of every tuning field.
[[nodiscard]] std::string tuning_file(const ConfigFields& fields);

/// The same for the options that a run is made with.
[[nodiscard]] std::string config_file(const RunOptions& options);

/// Sets a field. @param text  a value of TOML
/// @return what was expected instead, with the field as it was; empty: it is set
[[nodiscard]] std::string set_config(ConfigField& field, std::string_view text);

/// Lines of a configuration file that are no fields: sections with options of the command line.
struct ConfigSections {
  std::vector<std::string> names;
  /// Takes `key = value` of the section, or of none (empty); the value without its quotes.
  /// @return what is wrong with it; empty: nothing
  std::function<std::string(const std::string& section, std::string_view key, std::string_view value,
                            std::size_t line)>
      take = {};
};

/// Reads a configuration file, which is TOML; a value that is none, as in `dynamics = none`, counts as text.
/// Fields that it does not name keep their values.
/// @param file  its name, for errors
/// @throws InputError (file, line): what is no TOML, a field given twice among it; unknown table or key with
///         the nearest name, a wrong value with what was expected: fields before that line are set
/// @return a line (file, line, what took its place) for each field that an earlier version had: it has no
///         effect
std::vector<std::string> read_config(std::istream& in, const std::string& file, ConfigFields& fields,
                                     const ConfigSections& others = {});

/// The candidate that a user who typed `word` most likely meant; empty where none is near.
[[nodiscard]] std::string nearest_name(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
