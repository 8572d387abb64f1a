// SPDX-License-Identifier: BSD-3-Clause
#include "validators.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <string>
#include <system_error>

#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::app {

CLI::Validator finite() {
  return {[](std::string& text) {
            return runtime::parse_number(text) ? std::string()
                                               : fmt::format("'{}' is not a finite number", text);
          },
          ""};
}

CLI::Validator number_in(double low, double high) {
  return {[=](std::string& text) {
            const auto value = runtime::parse_number(text);
            return value && *value >= low && *value <= high
                       ? std::string()
                       : fmt::format("'{}' is not a number from {} to {}", text, low, high);
          },
          ""};
}

CLI::Validator positive() {
  return {[](std::string& text) {
            const auto value = runtime::parse_number(text);
            return value && *value > 0 ? std::string() : fmt::format("'{}' is not a number above 0", text);
          },
          ""};
}

CLI::Validator whole() {
  return {[](std::string& text) {
            std::uint64_t value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            return error == std::errc() && end == text.data() + text.size()
                       ? std::string()
                       : fmt::format("'{}' is not a whole number from 0", text);
          },
          ""};
}

}  // namespace dynslam::app
