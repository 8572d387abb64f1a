// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <iosfwd>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace dynslam::app {

/// Reads `option = value` lines (# comments, values bare or in quotes) into the command that was called.
/// Lines under [command] count for that command alone, so that one file can serve several.
/// What the command line gives wins. CLI11's own reader would ignore the file within a subcommand, and
/// knows no line numbers.
class ConfigFile : public CLI::ConfigBase {
 public:
  /// @param app  the program, its commands added
  explicit ConfigFile(CLI::App& app) : app_(app) {}

  /// @throws runtime::InputError (file, line): no `=`, unknown command or option, an option given twice
  std::vector<CLI::ConfigItem> from_config(std::istream& in) const override;

  /// "FILE:LINE: " where an error of CLI11 concerns a value from the file; else empty.
  [[nodiscard]] std::string origin(const std::string& error) const;

 private:
  CLI::App& app_;
  mutable std::map<std::string, std::string> where_;  // option -> "FILE:LINE: ", as the interface is const
};

/// Gives the program and each of its commands the option --config FILE.
std::shared_ptr<const ConfigFile> add_config_option(CLI::App& app);

/// The words of the command line with `--config FILE` moved in front of the command, where CLI11 looks for
/// it, in the reversed order that CLI::App::parse wants.
[[nodiscard]] std::vector<std::string> arguments(int argc, const char* const* argv);

}  // namespace dynslam::app
