// SPDX-License-Identifier: BSD-3-Clause
#include "config_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <istream>
#include <optional>
#include <string_view>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"

namespace dynslam::app {

std::vector<CLI::ConfigItem> ConfigFile::from_config(std::istream& in) const {
  std::vector<CLI::ConfigItem> result;
  const auto called = app_.get_subcommands();
  if (called.empty()) return result;  // CLI11 asks for a command next
  // `config` shows what `run` would do.
  const std::string name = called.front()->get_name() == "config" ? "run" : called.front()->get_name();
  const CLI::App& command = *app_.get_subcommand(name);
  const auto file = app_.get_config_ptr()->as<std::string>();
  runtime::ConfigSections sections;
  for (const CLI::App* one : std::as_const(app_).get_subcommands({}))
    sections.names.push_back(one->get_name());
  sections.take = [&](const std::string& section, std::string_view key, std::string_view value,
                      std::size_t line) -> std::string {
    if (!section.empty() && section != name) return {};
    return take(command, std::string(key), std::string(value), fmt::format("{}:{}: ", file, line), result);
  };
  runtime::RunOptions ignored;  // a file may serve several commands
  std::optional<runtime::DynamicsMode> ignored_mode;
  const auto own = fields_.find(name);
  auto fields = own != fields_.end() ? own->second : runtime::config_fields(ignored, ignored_mode);
  for (const std::string& note : runtime::read_config(in, file, fields, sections))
    std::cerr << "dynslam: warning: " << note << '\n';
  return result;
}

std::string ConfigFile::take(const CLI::App& command, const std::string& name, const std::string& value,
                             const std::string& place, std::vector<CLI::ConfigItem>& taken) const {
  const CLI::Option* option = command.get_option_no_throw("--" + name);
  if (option == nullptr) option = command.get_option_no_throw(name);  // positional
  if (name.empty() || option == nullptr || name == "help" || name == "config") {
    std::vector<std::string> names;
    for (const CLI::Option* one : command.get_options())
      names.insert(names.end(), one->get_lnames().begin(), one->get_lnames().end());
    const std::string near = runtime::nearest_name(name, names);
    return fmt::format("unknown option '{}' of {}{}", name, command.get_name(),
                       near.empty() ? near : ", did you mean " + near + "?");
  }
  if (!where_.emplace(name, place).second) return fmt::format("'{}' is given twice", name);
  if (!option->empty()) where_[name].clear();  // the command line's value counts, and its errors
  CLI::ConfigItem item;
  item.parents = {command.get_name()};
  item.name = name;
  item.inputs = {value};
  taken.push_back(std::move(item));
  return {};
}

std::string ConfigFile::origin(const std::string& error) const {
  const auto inside_name = [](char c) { return c == '-' || (c >= 'a' && c <= 'z'); };
  for (const auto& [name, place] : where_) {
    const auto at = error.find(name);
    if (at == std::string::npos) continue;
    const auto end = at + name.size();
    const bool starts = at == 0 || error.compare(at >= 2 ? at - 2 : 0, 2, "--") == 0;
    if (starts && (end == error.size() || !inside_name(error[end]))) return place;
  }
  return {};
}

std::shared_ptr<const ConfigFile> add_config_option(CLI::App& app,
                                                    std::map<std::string, runtime::ConfigFields> fields) {
  const std::string description =
      "Read options from FILE: `option = value` lines, also under [COMMAND], and the tables of dynslam "
      "config";
  app.set_config("--config", "", description)->type_name("FILE");
  app.allow_config_extras(false);
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    command->add_option("--config", description)->type_name("FILE");  // for --help: see arguments()
  }
  auto file = std::make_shared<ConfigFile>(app, std::move(fields));
  app.config_formatter(file);
  return file;
}

std::vector<std::string> arguments(int argc, const char* const* argv) {
  std::vector<std::string> words(argv + 1, argv + argc), config;
  for (auto word = words.begin(); word != words.end() && *word != "--";) {
    const bool joined = word->rfind("--config=", 0) == 0;
    if (!joined && (*word != "--config" || word + 1 == words.end())) {
      ++word;
      continue;
    }
    const auto end = word + (joined ? 1 : 2);
    // CLI11 opens the file as a stream, which waits for pipes and takes an error of reading for the end.
    const std::string name = joined ? word->substr(std::string_view("--config=").size()) : *(word + 1);
    (void)runtime::read_text(name);
    config.insert(config.end(), word, end);
    word = words.erase(word, end);
  }
  if (!words.empty() && words.front() == "config") {  // its file is that of --config
    for (auto word = words.begin() + 1; word != words.end();) {
      if (word->rfind('-', 0) == 0) {
        ++word;
        continue;
      }
      (void)runtime::read_text(*word);
      config.insert(config.end(), {"--config", *word});
      word = words.erase(word);
    }
  }
  words.insert(words.begin(), config.begin(), config.end());
  std::reverse(words.begin(), words.end());
  return words;
}

}  // namespace dynslam::app
