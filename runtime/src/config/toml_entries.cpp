// SPDX-License-Identifier: BSD-3-Clause
#include "config/toml_entries.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kMostDots = 1000;  // of a line: toml++ 3.3 recurses into nested tables, however deep they are

/// A line, 1-based; the empty one behind the text.
std::string_view line_at(std::string_view text, std::size_t number) {
  for (; number > 1; --number) text.remove_prefix(std::min(text.find('\n'), text.size() - 1) + 1);
  return text.substr(0, text.find('\n'));
}

/// Puts the bare value of a line into quotes. @return false: it has none
bool quote_value(std::string& text, std::string_view line) {
  const auto equals = line.find('=');
  if (equals == std::string_view::npos) return false;
  const std::string_view value = trim(without_comment(line.substr(equals + 1)));
  if (value.empty() || value.find_first_of("'\"[{") != std::string_view::npos) return false;
  text.replace(static_cast<std::size_t>(value.data() - text.data()), value.size(),
               fmt::format("'{}'", value));
  return true;
}

void add_entries(const std::string& name, const toml::table& table, std::vector<TomlEntry>& out) {
  const auto is_value = [](const auto& one) { return !one.second.is_table(); };
  if (!name.empty() && (table.empty() || std::any_of(table.begin(), table.end(), is_value)))
    out.push_back({name, {}, nullptr, table.source().begin.line});
  for (const auto& [key, value] : table) {
    std::string own(key.str());
    if (own.find('.') != std::string::npos) own = toml_text(own);  // one name, not several
    if (const toml::table* inner = value.as_table()) {
      add_entries(name.empty() ? own : name + '.' + own, *inner, out);
    } else {
      out.push_back({name, std::move(own), &value, key.source().begin.line});
    }
  }
}

/// Whether a value's text has a NUL, at which the system's functions and messages would end it.
bool has_nul(const toml::node& value) {
  if (const auto* text = value.as_string()) return text->get().find('\0') != std::string::npos;
  const toml::array* array = value.as_array();
  return array != nullptr && std::any_of(array->begin(), array->end(), has_nul);
}

/// @throws InputError (file, line)
void check_no_nul(const TomlEntry& entry, const std::string& file) {
  const std::string name = entry.table + (entry.table.empty() || entry.key.empty() ? "" : ".") + entry.key;
  if (name.find('\0') != std::string::npos || (entry.value != nullptr && has_nul(*entry.value)))
    throw InputError(file, entry.line, printable(name) + " has a NUL character");
}

/// What is wrong, and where.
InputError error_of(const toml::parse_error& error, std::string_view line, const std::string& file) {
  constexpr std::string_view kUsual = "Error while parsing ";
  std::string_view reason = error.description();
  if (reason.starts_with(kUsual)) reason.remove_prefix(kUsual.size());
  if (reason.starts_with("string: unescaped control") && !has_control(trim(line)))
    reason = "the closing quote is missing";
  return {file, error.source().begin.line, std::string(reason)};
}

/// The line, 1-based, at which toml++ breaks its own assertion.
std::size_t asserting_line(std::string_view text) {
  const auto passes = [&](std::size_t lines) {
    try {
      const std::string_view last = line_at(text, lines);
      (void)toml::parse(text.substr(0, static_cast<std::size_t>(last.data() + last.size() - text.data())));
      return true;
    } catch (const TomlAssertion&) {
      return false;
    }
  };
  auto first = std::size_t{1}, last = static_cast<std::size_t>(std::ranges::count(text, '\n')) + 1;
  while (first < last) {
    const std::size_t middle = first + (last - first) / 2;
    if (passes(middle)) {
      first = middle + 1;
    } else {
      last = middle;
    }
  }
  return first;
}

toml::parse_result parse(const std::string& text, const std::string& file) {
  try {
    return toml::parse(text);
  } catch (const TomlAssertion&) {
    throw InputError(file, asserting_line(text), "expected a name");
  }
}

}  // namespace

TomlFile read_toml(std::string text, const std::string& file) {
  std::size_t number = 1;
  int dots = 0;
  for (const char c : text) {
    if (c == '.' && ++dots > kMostDots) throw InputError(file, number, "has too many dots");
    if (c != '\n') continue;
    ++number;
    dots = 0;
  }
  for (;;) {
    toml::parse_result result = parse(text, file);
    if (result) {
      TomlFile toml{std::move(result).table(), {}};
      add_entries({}, toml.root, toml.entries);
      std::ranges::stable_sort(toml.entries, {}, &TomlEntry::line);
      for (const TomlEntry& entry : toml.entries) check_no_nul(entry, file);
      return toml;
    }
    const std::string_view line = line_at(text, result.error().source().begin.line);
    if (!quote_value(text, line)) throw error_of(result.error(), line, file);
  }
}

std::string toml_text(std::string_view value) {
  std::string result = "\"";
  for (const char c : value) {
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

std::string toml_text(const toml::node& value) {
  if (const auto* text = value.as_string()) return toml_text(std::string_view(text->get()));
  if (const auto* flag = value.as_boolean()) return flag->get() ? "true" : "false";
  if (const auto* number = value.as_integer()) return std::to_string(number->get());
  if (const auto* number = value.as_floating_point()) return toml_text(number->get());
  if (const auto* array = value.as_array()) {
    std::string result;
    for (const toml::node& one : *array) result += (result.empty() ? "" : ", ") + toml_text(one);
    return '[' + result + ']';
  }
  std::ostringstream time;
  value.visit([&](const auto& one) {
    if constexpr (toml::is_chronological<decltype(one)>) time << one.get();
  });
  return value.is_table() ? "a table" : time.str();
}

std::string toml_word(const toml::node& value) {
  const auto* text = value.as_string();
  return text != nullptr ? text->get() : toml_text(value);
}

}  // namespace dynslam::runtime
