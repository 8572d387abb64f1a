// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "dynslam/runtime/error.hpp"

namespace dynslam::test {

/// The message of the InputError that `f` throws; empty when it throws none.
template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const runtime::InputError& error) {
    return error.what();
  }
  return {};
}

inline bool mentions(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace dynslam::test
