// SPDX-License-Identifier: BSD-3-Clause
// The program as a user calls it.
#pragma once

#include <doctest/doctest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace dynslam::test {

struct ProgramResult {
  int code;
  std::string out;  ///< stdout; with call() stderr, too
};

/// A command of the shell.
inline ProgramResult shell(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  ProgramResult result{0, {}};
  std::array<char, 4096> buffer;
  while (const std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe))
    result.out.append(buffer.data(), n);
  result.code = WEXITSTATUS(pclose(pipe));
  return result;
}

#ifdef DYNSLAM_PROGRAM
/// `dynslam ARGUMENTS`
inline ProgramResult call(const std::string& arguments) {
  std::string command = DYNSLAM_PROGRAM " ";
  return shell(command.append(arguments).append(" 2>&1"));
}
#endif

}  // namespace dynslam::test
