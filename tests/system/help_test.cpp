// SPDX-License-Identifier: BSD-3-Clause
// Manual pages and completions say what the program has.
#include <doctest/doctest.h>

#include <regex>
#include <set>
#include <string>

#include "program.hpp"

using namespace dynslam;

namespace {

std::set<std::string> long_options(const std::string& text) {
  static const std::regex option("--[a-z][a-z-]+");
  return {std::sregex_token_iterator(text.begin(), text.end(), option), std::sregex_token_iterator()};
}

/// A page with its minus signs as they are typed.
std::string page(const std::string& command) {
  const auto printed = test::call("man " + command);
  REQUIRE(printed.code == 0);
  return std::regex_replace(printed.out, std::regex(R"(\\-)"), "-");
}

/// What bash offers after `words`, the last of which is being typed.
std::string completed(const std::string& words, int typed) {
  const auto result =
      test::shell("bash -c 'source <(" DYNSLAM_PROGRAM " completion bash); COMP_WORDS=(" + words +
                  "); COMP_CWORD=" + std::to_string(typed) + "; _dynslam; echo \"${COMPREPLY[@]}\"' 2>&1");
  REQUIRE(result.code == 0);
  return result.out.substr(0, result.out.size() - 1);
}

}  // namespace

TEST_CASE("each command has a manual page with all of its options") {
  const std::string program = page("");
  for (const char* command : {"run", "ablate", "eval", "eval-masks", "mask-faults", "info", "readout",
                              "convert", "synth", "map", "masks", "sweep", "report", "config", "man"}) {
    CAPTURE(command);
    CHECK(program.find("dynslam-" + std::string(command)) != std::string::npos);
    const std::string text = page(command);
    CHECK(text.starts_with(".TH dynslam-" + std::string(command) + " 1"));
    const auto said = long_options(text);
    for (const std::string& option : long_options(test::call(std::string(command) + " --help").out)) {
      CAPTURE(option);
      CHECK(said.contains(option));
    }
  }
  CHECK(test::call("man ruin").code == 2);
}

TEST_CASE("bash completes commands, options and the values of options") {
  CHECK(completed("dynslam ab", 1) == "ablate");
  CHECK(completed("dynslam run --dyn", 2) == "--dynamic-classes --dynamics");
  CHECK(completed("dynslam run seq --dynamics \"\"", 4) == "none semantic geometric both");
  CHECK(completed("dynslam run seq --dynamics g", 4) == "geometric");
  CHECK(completed("dynslam run se", 2).empty());  // files: the shell's own
  CHECK(test::call("completion fish").out.find("-l dynamics -x -a 'none semantic geometric both'") !=
        std::string::npos);
  CHECK(test::call("completion zsh").out.starts_with("#compdef dynslam\n"));
  CHECK(test::call("completion csh").code == 2);
}
