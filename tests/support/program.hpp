// SPDX-License-Identifier: BSD-3-Clause
// The program as a user calls it.
#pragma once

#include <doctest/doctest.h>
#include <sys/wait.h>

#include <algorithm>
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

/// `dynslam ARGUMENTS` fails with the code, and what it prints is one line that has `part`.
inline void check_one_line_error(const std::string& arguments, int code, const std::string& part) {
  const ProgramResult r = call(arguments);
  CAPTURE(arguments);
  CAPTURE(r.out);
  CHECK(r.code == code);
  CHECK(r.out.rfind("dynslam: error: ", 0) == 0);
  CHECK(std::count(r.out.begin(), r.out.end(), '\n') == 1);
  CHECK(r.out.find(part) != std::string::npos);
}
#endif

}  // namespace dynslam::test
