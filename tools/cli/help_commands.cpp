// SPDX-License-Identifier: BSD-3-Clause
#include "help_commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>

#include "dynslam/runtime/error.hpp"
#include "manual.hpp"

namespace dynslam::app {

HelpCommands::HelpCommands(CLI::App& app)
    : app_(app),
      man_(app.add_subcommand("man", "Print a manual page: dynslam man run | man -l -")),
      completion_(app.add_subcommand("completion", "Print what completes commands and options in a shell")) {
  man_->prefix_command();  // what follows is a command's name, not a command
  man_->footer("COMMAND: the command that the page is about (default: the program)");
  completion_->add_option("shell", shell_, "bash, zsh, fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
}

int HelpCommands::run() const {
  if (completion_->parsed()) {
    std::cout << completion_script(app_, shell_);
    return 0;
  }
  const CLI::App* command = nullptr;
  if (const auto words = man_->remaining(); !words.empty()) {
    const auto found = app_.get_subcommands([&](const CLI::App* c) { return c->get_name() == words[0]; });
    if (found.empty() || words.size() > 1)
      throw runtime::UsageError(fmt::format("unknown command '{}'", fmt::join(words, " ")));
    command = found.front();
  }
  std::cout << manual_page(app_, command);
  return 0;
}

}  // namespace dynslam::app
