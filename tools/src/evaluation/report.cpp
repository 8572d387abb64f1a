// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

/// Cell of a row that may be shorter than the header.
const std::string& at(const std::vector<std::string>& row, std::size_t column) {
  static const std::string empty;
  return column < row.size() ? row[column] : empty;
}

}  // namespace

std::string markdown_text(std::string_view text) {
  std::string result;
  for (const char c : printable(text)) {
    if (c == '<' || c == '>' || c == '&') {
      result += c == '<' ? "&lt;" : c == '>' ? "&gt;" : "&amp;";
    } else {
      if (std::string_view("\\|`").find(c) != std::string_view::npos) result += '\\';
      result += c;
    }
  }
  return result;
}

std::string cell(double value, int decimals, const std::string& unit) {
  if (!std::isfinite(value)) return "-";
  const std::string text = fmt::format("{:.{}f}", value, decimals);
  const bool minus_zero = text.find_first_not_of("-0.") == std::string::npos && text.front() == '-';
  return (minus_zero ? text.substr(1) : text) + unit;
}

std::string to_text(const Table& table) {
  std::vector<std::size_t> width(table.header.size(), 0);
  const auto measure = [&](const std::vector<std::string>& row) {
    for (std::size_t c = 0; c < width.size(); ++c) width[c] = std::max(width[c], at(row, c).size());
  };
  measure(table.header);
  std::for_each(table.rows.begin(), table.rows.end(), measure);
  std::string text = table.title + '\n';
  const auto add = [&](const std::vector<std::string>& row) {
    std::string line;
    for (std::size_t c = 0; c < width.size(); ++c) {
      line += c == 0 ? fmt::format("{:<{}}", at(row, c), width[c])
                     : fmt::format("  {:>{}}", at(row, c), width[c]);
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  };
  add(table.header);
  std::for_each(table.rows.begin(), table.rows.end(), add);
  return text;
}

std::string to_markdown(const Table& table) {
  std::string text = fmt::format("### {}\n\n", table.title);
  const auto add = [&](const std::vector<std::string>& row) {
    text += '|';
    for (std::size_t c = 0; c < table.header.size(); ++c) {
      text += ' ' + markdown_text(at(row, c)) + " |";
    }
    text += '\n';
  };
  add(table.header);
  text += '|';
  for (std::size_t c = 0; c < table.header.size(); ++c) text += c == 0 ? "---|" : "---:|";
  text += '\n';
  std::for_each(table.rows.begin(), table.rows.end(), add);
  return text;
}

}  // namespace dynslam::runtime
