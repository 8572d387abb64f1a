// SPDX-License-Identifier: BSD-3-Clause
#include "config/toml_value.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <utility>

namespace dynslam::runtime {
namespace {

/// Reads a value from the front of a text. Functions return what is wrong; empty: nothing.
class TomlReader {
 public:
  explicit TomlReader(std::string_view text) : text_(text) {}

  std::string value(TomlValue& out, int depth = 0) {
    skip_blanks();
    if (text_.empty() || text_.front() == '#') return "a value is missing";
    switch (text_.front()) {
      case '"':
        return quoted(out.value.emplace<std::string>());
      case '\'':
        return literal(out.value.emplace<std::string>());
      case '[':
        return depth < kDeepest ? array(out.value.emplace<TomlArray>(), depth) : "arrays are nested too deep";
      default:
        return bare(out);
    }
  }
  std::string end() {
    skip_blanks();
    if (text_.empty() || text_.front() == '#') return {};
    return fmt::format("'{}' follows the value", text_);
  }

 private:
  static constexpr int kDeepest = 4;

  void skip_blanks() { text_.remove_prefix(std::min(text_.find_first_not_of(" \t\r"), text_.size())); }

  std::string literal(std::string& out) {
    const auto close = text_.find('\'', 1);
    if (close == std::string_view::npos) return "the closing ' is missing";
    out = text_.substr(1, close - 1);
    text_.remove_prefix(close + 1);
    return {};
  }

  std::string quoted(std::string& out) {
    for (text_.remove_prefix(1); !text_.empty(); text_.remove_prefix(1)) {
      if (text_.front() == '"') {
        text_.remove_prefix(1);
        return {};
      }
      if (text_.front() != '\\') {
        out += text_.front();
      } else if (std::string reason = escape(out); !reason.empty()) {
        return reason;
      }
    }
    return "the closing \" is missing";
  }

  /// Leaves the last character of the escape at the front.
  std::string escape(std::string& out) {
    constexpr std::string_view kLetters = "btnfre\"\\", kMeaning = "\b\t\n\f\r\x1b\"\\";
    text_.remove_prefix(1);
    const char letter = text_.empty() ? '\0' : text_.front();
    if (letter == 'u') {
      std::uint32_t code = 0;
      const char* digits = text_.data() + 1;
      const char* last = digits + 4;
      if (text_.size() < 5 || std::from_chars(digits, last, code, 16).ptr != last || code > 0x7f)
        return "expected \\u with four hexadecimal digits, up to 007f";  // what we write; others stand as
                                                                         // they are
      out += static_cast<char>(code);
      text_.remove_prefix(4);
      return {};
    }
    const auto known = kLetters.find(letter);
    if (known == std::string_view::npos) return fmt::format("'\\{}' is unknown in a string", letter);
    out += kMeaning[known];
    return {};
  }

  std::string array(TomlArray& out, int depth) {
    text_.remove_prefix(1);
    for (bool separated = true;;) {
      skip_blanks();
      if (text_.empty() || text_.front() == '#') return "the closing ] is missing on this line";
      if (text_.front() == ']') {
        text_.remove_prefix(1);
        return {};
      }
      if (!separated) return "a comma is missing between two values";
      if (std::string reason = value(out.emplace_back(), depth + 1); !reason.empty()) return reason;
      skip_blanks();
      separated = !text_.empty() && text_.front() == ',';
      if (separated) text_.remove_prefix(1);
    }
  }

  std::string bare(TomlValue& out) {
    const std::string_view word = text_.substr(0, text_.find_first_of(" \t\r#,]"));
    text_.remove_prefix(word.size());
    if (word == "true" || word == "false") {
      out.value = word == "true";
      return {};
    }
    if (word.find_first_not_of("0123456789+-._eEinfa") != std::string_view::npos)
      return fmt::format("'{}' is no value; text stands in quotes", word);
    std::string digits(word);
    std::erase(digits, '_');
    if (!digits.empty() && digits.front() == '+') digits.erase(0, 1);
    out.value = TomlNumber{std::move(digits)};
    return {};
  }

  std::string_view text_;
};

}  // namespace

std::string parse_toml(std::string_view text, TomlValue& result) {
  TomlReader reader(text);
  std::string reason = reader.value(result);
  return reason.empty() ? reader.end() : reason;
}

std::string toml_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      result += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      result += c;
    }
  }
  return result + '"';
}

}  // namespace dynslam::runtime
