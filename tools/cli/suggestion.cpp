// SPDX-License-Identifier: BSD-3-Clause
#include "suggestion.hpp"

#include <algorithm>

#include "dynslam/runtime/config/options_file.hpp"

namespace dynslam::app {

std::string suggestion(const CLI::App& app, const std::vector<std::string>& words) {
  const auto chosen = app.get_subcommands();
  const CLI::App& command = chosen.empty() ? app : *chosen.front();
  std::vector<std::string> names;
  for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(sub->get_name());
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  for (const std::string& word : words) {
    const std::string typed = word.substr(0, word.find('='));
    if (std::find(names.begin(), names.end(), typed) != names.end()) continue;
    if (!chosen.empty() && typed.rfind("--", 0) != 0) continue;  // a file, or a value
    if (const std::string name = runtime::nearest_name(typed, names); !name.empty())
      return ", did you mean " + name + "?";
  }
  return {};
}

}  // namespace dynslam::app
