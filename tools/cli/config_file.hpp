// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <iosfwd>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/runtime/config/options_file.hpp"

namespace dynslam::app {

/// Reads `option = value` lines (# comments, values bare or in quotes) into the command that was called, and
/// tables of fields into its options (see options_file.hpp). Lines under [command] count for that command
/// alone, so that one file can serve several. What the command line gives wins, then options, then fields.
/// CLI11's own reader would ignore the file within a subcommand, and knows no line numbers.
class ConfigFile : public CLI::ConfigBase {
 public:
  /// @param app     the program, its commands added
  /// @param fields  of the commands that have some
  ConfigFile(CLI::App& app, std::map<std::string, runtime::ConfigFields> fields)
      : app_(app), fields_(std::move(fields)) {}

  /// @throws runtime::InputError (file, line): no `=`, unknown command, table, option or field, one that is
  ///         given twice, a field's value that it cannot have
  std::vector<CLI::ConfigItem> from_config(std::istream& in) const override;

  /// "FILE:LINE: " where an error of CLI11 concerns a value from the file; else empty.
  [[nodiscard]] std::string origin(const std::string& error) const;

 private:
  /// Takes an option's line. @return what is wrong with it; empty: nothing
  std::string take(const CLI::App& command, const std::string& name, const std::string& value,
                   const std::string& place, std::vector<CLI::ConfigItem>& taken) const;

  CLI::App& app_;
  std::map<std::string, runtime::ConfigFields> fields_;
  mutable std::map<std::string, std::string> where_;  // option -> "FILE:LINE: ", as the interface is const
};

/// Gives the program and each of its commands the option --config FILE.
/// @param fields  of the commands that have some, by their names
std::shared_ptr<const ConfigFile> add_config_option(CLI::App& app,
                                                    std::map<std::string, runtime::ConfigFields> fields);

/// The words of the command line with `--config FILE` (for the command `config`: FILE) moved in front of the
/// command, where CLI11 looks for it, in the reversed order that CLI::App::parse wants.
[[nodiscard]] std::vector<std::string> arguments(int argc, const char* const* argv);

}  // namespace dynslam::app
