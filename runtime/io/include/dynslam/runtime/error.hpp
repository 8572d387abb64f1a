// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <stdexcept>
#include <string>

namespace dynslam::runtime {

/// Bad input or output: what() is "FILE:LINE: reason", or "FILE: reason" where no line applies.
class InputError : public std::runtime_error {
 public:
  /// @param line  1-based; 0: the whole file
  InputError(const std::string& file, std::size_t line, const std::string& reason)
      : std::runtime_error(line > 0 ? file + ":" + std::to_string(line) + ": " + reason
                                    : file + ": " + reason) {}
};

/// A request that makes no sense: wrong option values or combinations.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
