// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/text_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {
constexpr std::string_view kSeparators = " \t,\r";

bool is_control(char c) {
  return (c >= 0 && c < ' ') || c == 0x7F;
}
}  // namespace

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::string_view unquoted(std::string_view text) {
  const bool quoted =
      text.size() >= 2 && text.front() == text.back() && (text.front() == '"' || text.front() == '\'');
  return quoted ? text.substr(1, text.size() - 2) : text;
}

std::string_view without_comment(std::string_view text) {
  char quote = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (quote != 0) {
      if (text[i] == quote) quote = 0;
    } else if (text[i] == '"' || text[i] == '\'') {
      quote = text[i];
    } else if (text[i] == '#' && (i == 0 || text[i - 1] == ' ' || text[i - 1] == '\t')) {
      return text.substr(0, i);
    }
  }
  return text;
}

std::vector<std::string_view> split_words(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t at = line.find_first_not_of(kSeparators);
  while (at != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(kSeparators, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kSeparators, end);
  }
  return words;
}

std::optional<double> parse_number(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

bool has_control(std::string_view text) {
  return std::any_of(text.begin(), text.end(), is_control);
}

std::string printable(std::string_view text) {
  std::string result;
  for (const char c : text)
    result += is_control(c) ? fmt::format("\\x{:02x}", static_cast<unsigned char>(c)) : std::string(1, c);
  return result;
}

std::string_view without_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  return text;
}

std::string as_utf8(std::string text, const std::string& name) {
  const std::string_view start = std::string_view(text).substr(0, 4);
  const auto is = [&](std::size_t i) { return i < start.size() && start[i] != 0; };
  const auto zero = [&](std::size_t i) { return i < start.size() && start[i] == 0; };
  // By their marks, or, where there is none, by the zeros of what begins with two letters of ASCII.
  const bool wide =
      start == std::string_view("\xFF\xFE\0\0", 4) || start == std::string_view("\0\0\xFE\xFF", 4);
  const bool utf16 = start.starts_with("\xFF\xFE") || start.starts_with("\xFE\xFF") ||
                     (is(0) && zero(1) && is(2) && zero(3)) || (zero(0) && is(1) && zero(2) && is(3));
  if (wide || utf16)
    throw InputError(name, 0, fmt::format("is text in UTF-{}: save it as UTF-8", wide ? 32 : 16));
  text.erase(0, text.size() - without_mark(text).size());
  return text;
}

bool LineReader::next() {
  while (std::getline(in_, line_)) {
    if (number_ == 0) line_.erase(0, line_.size() - without_mark(line_).size());
    ++number_;
    const std::size_t first = line_.find_first_not_of(kSeparators);
    if (first != std::string::npos && line_[first] != '#') return true;
  }
  return false;
}

}  // namespace dynslam::runtime
