// SPDX-License-Identifier: BSD-3-Clause
#include "validators.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

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

CLI::Validator whole_in(int low, int high) {
  return {[=](std::string& text) {
            int value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool good = error == std::errc() && end == text.data() + text.size();
            return good && value >= low && value <= high
                       ? std::string()
                       : fmt::format("'{}' is not a whole number from {} to {}", text, low, high);
          },
          ""};
}

CLI::Validator auto_or(CLI::Validator other) {
  return {[other = std::move(other)](std::string& text) {
            if (text == "auto") return std::string();
            const std::string wrong = other(text);
            return wrong.empty() ? wrong : wrong + ", nor auto";
          },
          ""};
}

CLI::Validator image_size() {
  return {[](const std::string& text) {
            const auto number = [](std::string_view s) {
              return !s.empty() && s.size() < 6 &&
                     s.find_first_not_of("0123456789") == std::string_view::npos &&
                     s.find_first_not_of('0') != std::string_view::npos;
            };
            const std::size_t x = text.find('x');
            const bool good = x != std::string::npos && number(std::string_view(text).substr(0, x)) &&
                              number(std::string_view(text).substr(x + 1));
            return good ? std::string() : fmt::format("'{}' is not a size as 848x480", text);
          },
          ""};
}

std::pair<int, int> parse_image_size(const std::string& text) {
  return {std::stoi(text), std::stoi(text.substr(text.find('x') + 1))};
}

}  // namespace dynslam::app
