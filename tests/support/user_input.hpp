// SPDX-License-Identifier: BSD-3-Clause
// An input as people have it: what is done to a sound sequence, the command, and what the program says.
#pragma once

#include <doctest/doctest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "error_text.hpp"
#include "program.hpp"
#include "small_sequence.hpp"

namespace dynslam::test {

struct UserInput {
  std::string name;
  std::function<void(const std::filesystem::path&)> change;  ///< of the sequence in a folder
  std::string command;                                       ///< SEQ and OUT stand for folders
  int code = 0;
  std::vector<std::string> says, never_says{};
};

inline constexpr const char* kRun = "run SEQ --dynamics none --no-map --out OUT";
inline constexpr const char* kInfo = "info SEQ";

inline std::string filled(std::string text, const std::string& name, const std::string& value) {
  for (std::size_t at = text.find(name); at != std::string::npos; at = text.find(name, at + value.size()))
    text.replace(at, name.size(), value);
  return text;
}

inline void check_input(const UserInput& input) {
  CAPTURE(input.name);
  const TemporaryFolder folder;
  const std::filesystem::path sequence = folder.path / "seq";
  copy_sequence(sequence);
  if (input.change) input.change(sequence);
  const std::string command =
      filled(filled(input.command, "SEQ", sequence.string()), "OUT", (folder.path / "out").string());
  const ProgramResult result = call(command);
  CAPTURE(command);
  CAPTURE(result.out);
  CHECK(result.code == input.code);
  CHECK_FALSE(result.out.empty());
  if (result.code != 0) CHECK(result.out.find("dynslam: error: ") != std::string::npos);
  for (const std::string& text : input.says) {
    CAPTURE(text);
    CHECK(mentions(result.out, text));
  }
  for (const std::string& text : input.never_says) {
    CAPTURE(text);
    CHECK_FALSE(mentions(result.out, text));
  }
}

inline void check_all(const std::vector<UserInput>& inputs) {
  for (const UserInput& input : inputs) check_input(input);
}

/// What a run of the whole sequence says.
inline const std::vector<std::string> kTracked{"8 of 8 frames tracked", "ATE [m]"};

}  // namespace dynslam::test
