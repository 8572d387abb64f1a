// SPDX-License-Identifier: BSD-3-Clause
#include "manual.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

namespace dynslam::app {
namespace {

std::vector<const CLI::App*> commands(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

/// Text for roff: a minus stays one, and no line is taken for a request.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (out.empty() && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c == '\n' ? ' ' : c;
    }
  }
  return out;
}

/// What stands behind an option's name: a word for its value, empty for a flag.
std::string value_word(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return {};
  const std::string type = option.get_type_name();
  return type.substr(0, type.find(':'));
}

/// The values of which an option takes one; none: any.
std::vector<std::string> values(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t begin = type.find('{'), end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos) return {};
  return CLI::detail::split(type.substr(begin + 1, end - begin - 1), ',');
}

std::vector<std::string> flags(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

void append_options(std::string& page, const CLI::App& command) {
  std::string positional, options;
  for (const CLI::Option* option : command.get_options()) {
    const std::string value = value_word(*option);
    std::string about = roff(option->get_description());
    const auto choice = values(*option);
    if (!choice.empty() && about.find(roff(choice.front())) == std::string::npos)
      about += roff(fmt::format(" ({})", fmt::join(choice, ", ")));
    if (const std::string text = option->get_default_str(); !text.empty())
      about += roff(fmt::format(" [{}]", text));
    if (option->nonpositional()) {
      options +=
          fmt::format(".TP\n\\fB{}\\fR{}\n{}\n", roff(fmt::format("{}", fmt::join(flags(*option), ", "))),
                      value.empty() ? "" : fmt::format(" \\fI{}\\fR", roff(value)), about);
    } else {
      positional += fmt::format(".TP\n\\fI{}\\fR\n{}\n", roff(option->get_name(true)), about);
    }
  }
  if (!positional.empty()) page += ".SH ARGUMENTS\n" + positional;
  if (!options.empty()) page += ".SH OPTIONS\n" + options;
}

std::string words(const std::vector<std::string>& list) {
  return fmt::format("{}", fmt::join(list, " "));
}

std::vector<std::string> names(const CLI::App& app) {
  std::vector<std::string> all;
  for (const CLI::App* command : commands(app)) all.push_back(command->get_name());
  return all;
}

std::vector<std::string> all_flags(const CLI::App& command) {
  std::vector<std::string> all;
  for (const CLI::Option* option : command.get_options()) {
    for (std::string& flag : flags(*option)) all.push_back(std::move(flag));
  }
  return all;
}

std::string bash(const CLI::App& app) {
  std::string out =
      "# bash completion for dynslam\n"
      "_dynslam() {\n"
      "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}\n"
      "  COMPREPLY=()\n"
      "  if [ \"$COMP_CWORD\" = 1 ]; then\n";
  out += fmt::format("    COMPREPLY=($(compgen -W '{} {}' -- \"$word\"))\n    return\n  fi\n",
                     words(names(app)), words(all_flags(app)));
  out += "  case ${COMP_WORDS[1]}:$before in\n";
  for (const CLI::App* command : commands(app)) {
    for (const CLI::Option* option : command->get_options()) {
      const auto choice = values(*option);
      if (choice.empty()) continue;
      for (const std::string& flag : flags(*option))
        out += fmt::format("  {}:{}) COMPREPLY=($(compgen -W '{}' -- \"$word\")); return ;;\n",
                           command->get_name(), flag, words(choice));
    }
  }
  out += "  esac\n  case $word in\n  -*) ;;\n  *) return ;;\n  esac\n  case ${COMP_WORDS[1]} in\n";
  for (const CLI::App* command : commands(app))
    out += fmt::format("  {}) COMPREPLY=($(compgen -W '{}' -- \"$word\")) ;;\n", command->get_name(),
                       words(all_flags(*command)));
  return out + "  esac\n}\ncomplete -o bashdefault -o default -F _dynslam dynslam\n";
}

/// Within single quotes of a shell.
std::string quoted(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out;
}

std::string fish(const CLI::App& app) {
  std::string out = "# fish completion for dynslam\n";
  for (const CLI::App* command : commands(app)) {
    out += fmt::format("complete -c dynslam -n __fish_use_subcommand -f -a {} -d '{}'\n", command->get_name(),
                       quoted(command->get_description()));
    for (const CLI::Option* option : command->get_options()) {
      if (!option->nonpositional()) continue;
      out += fmt::format("complete -c dynslam -n '__fish_seen_subcommand_from {}'", command->get_name());
      for (const std::string& name : option->get_snames()) out += " -s " + name;
      for (const std::string& name : option->get_lnames()) out += " -l " + name;
      if (const auto choice = values(*option); !choice.empty()) {
        out += fmt::format(" -x -a '{}'", words(choice));
      } else if (!value_word(*option).empty()) {
        out += " -r";
      }
      out += fmt::format(" -d '{}'\n", quoted(option->get_description()));
    }
  }
  return out;
}

}  // namespace

std::string manual_page(const CLI::App& app, const CLI::App* command) {
  const std::string name = command == nullptr ? app.get_name() : app.get_name() + "-" + command->get_name();
  const CLI::App& shown = command == nullptr ? app : *command;
  std::string page =
      fmt::format(".TH {} 1 \"\" \"dynslam " DYNSLAM_VERSION "\" \"User Commands\"\n", roff(name));
  page += fmt::format(".SH NAME\n{} \\- {}\n.SH SYNOPSIS\n", roff(name), roff(shown.get_description()));
  if (command == nullptr) {
    page += ".B dynslam\n.I COMMAND\n[\\fIOPTIONS\\fR]\n";
  } else {
    page += fmt::format(".B dynslam {}\n[\\fIOPTIONS\\fR]", roff(command->get_name()));
    for (const CLI::Option* option : command->get_options())
      if (!option->nonpositional()) page += fmt::format(" \\fI{}\\fR", roff(option->get_name(true)));
    page += '\n';
  }
  if (command == nullptr) {
    page += ".SH COMMANDS\n";
    for (const CLI::App* c : commands(app))
      page +=
          fmt::format(".TP\n\\fBdynslam\\-{}\\fR(1)\n{}\n", roff(c->get_name()), roff(c->get_description()));
  }
  append_options(page, shown);
  page +=
      ".SH EXIT STATUS\n0 on success, 1 for input that cannot be used, 2 for wrong options, 130 when "
      "interrupted.\n";
  return page;
}

std::string completion_script(const CLI::App& app, const std::string& shell) {
  if (shell == "fish") return fish(app);
  if (shell == "zsh") return "#compdef dynslam\nautoload -U +X bashcompinit && bashcompinit\n" + bash(app);
  return bash(app);
}

}  // namespace dynslam::app
