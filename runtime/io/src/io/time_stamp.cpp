// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/time_stamp.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstddef>

#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::size_t kDecimals = 9;
constexpr std::size_t kEpochDigits = 19;  // of nanoseconds since 1970, from 2001 to 2262

std::optional<std::int64_t> whole_number(std::string_view digits) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() || value < 0) return std::nullopt;
  return value;
}

bool all_digits(std::string_view word) {
  return std::all_of(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// Nanoseconds of plain decimals; 0 where they are no plain decimals, or too many.
std::int64_t nanoseconds_of(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const std::size_t point = std::min(word.find('.'), word.size());
  const std::string_view whole = word.substr(0, point);
  std::string decimals(word.substr(std::min(point + 1, word.size())));
  constexpr std::int64_t kMostSeconds = 9'000'000'000;
  if (whole.empty() || !all_digits(whole) || !all_digits(decimals)) return 0;
  const auto seconds = whole_number(whole);
  if (!seconds || *seconds > kMostSeconds) return 0;
  const bool up = decimals.size() > kDecimals && decimals[kDecimals] >= '5';
  decimals.resize(kDecimals, '0');
  return *seconds * kSecond + whole_number(decimals).value_or(0) + (up ? 1 : 0);
}

}  // namespace

std::optional<TimeStamp> parse_time(std::string_view word) {
  if (word.size() == kEpochDigits && word.front() != '0' && all_digits(word)) {
    if (const auto ns = whole_number(word)) return time_of(*ns);
  }
  const auto t = parse_number(word);
  if (!t) return std::nullopt;
  return TimeStamp{*t, nanoseconds_of(word)};
}

TimeStamp time_of(std::int64_t ns) {
  // In two parts: as one number they would be rounded to 256 ns first.
  return {static_cast<double>(ns / kSecond) + 1e-9 * static_cast<double>(ns % kSecond), ns};
}

std::string nanosecond_text(std::int64_t ns) {
  const std::int64_t whole = ns / kSecond, rest = ns % kSecond;
  return fmt::format("{}{}.{:09}", ns < 0 ? "-" : "", whole < 0 ? -whole : whole, rest < 0 ? -rest : rest);
}

}  // namespace dynslam::runtime
