// SPDX-License-Identifier: BSD-3-Clause
// The values of fields, to and from TOML.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <concepts>
#include <type_traits>

#include "config/toml_entries.hpp"
#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::string_view kAuto = "auto";

template <class Strings>
std::string array_text(const Strings& strings) {
  std::string text;
  for (const auto& one : strings) text += (text.empty() ? "" : ", ") + toml_text(one);
  return '[' + text + ']';
}

/// Texts of the values, by type.
struct ConfigText {
  std::string operator()(const bool* value) const { return *value ? "true" : "false"; }
  std::string operator()(const int* value) const { return std::to_string(*value); }
  std::string operator()(const std::uint64_t* value) const { return std::to_string(*value); }
  template <std::floating_point T>
  std::string operator()(const T* value) const {
    return toml_text(*value);
  }
  std::string operator()(const std::string* value) const { return toml_text(*value); }
  std::string operator()(const std::filesystem::path* value) const { return toml_text(value->string()); }
  std::string operator()(const std::vector<std::string>* value) const { return array_text(*value); }
  std::string operator()(std::span<double> values) const {
    std::string text;
    for (const double one : values) text += (text.empty() ? "" : ", ") + toml_text(one);
    return '[' + text + ']';
  }
  std::string operator()(const cv::Size* value) const {
    return fmt::format("[{}, {}]", value->width, value->height);
  }
  std::string operator()(const std::optional<double>* value) const {
    return *value ? toml_text(**value) : toml_text(kAuto);
  }
  std::string operator()(const ConfigChoice& choice) const { return toml_text(choice.get()); }
};

/// Takes a TOML value where it is of the right kind; otherwise says what was expected.
class ConfigSetter {
 public:
  ConfigSetter(const toml::node& value, const ConfigRange& range) : value_(value), range_(range) {}

  std::string operator()(bool* out) const {
    const auto* flag = value_.as_boolean();
    if (flag == nullptr) return "true or false";
    *out = flag->get();
    return {};
  }
  template <class T>
    requires(std::integral<T> || std::floating_point<T>)
  std::string operator()(T* out) const {
    const std::optional<T> number = parse<T>(value_);
    if (!number) return number_kind<T>() + (range_.text().empty() ? "" : ", " + range_.text());
    *out = *number;
    return {};
  }
  std::string operator()(std::string* out) const {
    const std::string* text = string_in(value_);
    if (text == nullptr) return "a string in quotes";
    *out = *text;
    return {};
  }
  std::string operator()(std::filesystem::path* out) const {
    std::string text;
    std::string reason = (*this)(&text);
    if (reason.empty()) *out = text;
    return reason;
  }
  std::string operator()(std::vector<std::string>* out) const {
    const auto texts = strings();
    if (!texts) return "an array of strings, like [\"chair\", \"tv\"]";
    *out = *texts;
    return {};
  }
  std::string operator()(std::span<double> out) const {
    const auto numbers = array<double>(out.size());
    if (!numbers) return fmt::format("an array of {} numbers, each {}", out.size(), range_.text());
    std::copy(numbers->begin(), numbers->end(), out.begin());
    return {};
  }
  std::string operator()(cv::Size* out) const {
    const auto numbers = array<int>(2);
    if (!numbers) return fmt::format("[width, height], each {}", range_.text());
    *out = {(*numbers)[0], (*numbers)[1]};
    return {};
  }
  std::string operator()(std::optional<double>* out) const {
    const std::string* text = string_in(value_);
    const std::optional<double> number = parse<double>(value_);
    if (!number && (text == nullptr || *text != kAuto))
      return fmt::format("\"auto\" or a number, {}", range_.text());
    *out = number;
    return {};
  }
  std::string operator()(ConfigChoice& choice) const {
    const std::string* text = string_in(value_);
    if (text == nullptr || std::find(choice.names.begin(), choice.names.end(), *text) == choice.names.end())
      return fmt::format("one of \"{}\"", fmt::join(choice.names, "\", \""));
    choice.set(*text);
    return {};
  }

 private:
  static const std::string* string_in(const toml::node& value) {
    const auto* text = value.as_string();
    return text != nullptr ? &text->get() : nullptr;
  }
  template <class T>
  static std::string number_kind() {
    return std::floating_point<T> ? "a finite number"
           : std::is_signed_v<T>  ? "a whole number"
                                  : "a whole number from 0";
  }
  template <class T>
  [[nodiscard]] std::optional<T> parse(const toml::node& node) const {
    T value{};
    if constexpr (std::floating_point<T>) {
      const std::optional<double> number = node.value<double>();
      if (!number) return std::nullopt;
      value = static_cast<T>(*number);
    } else {
      // Of digits alone where TOML has no number so large.
      const std::string word = std::is_signed_v<T> && !node.is_integer() ? std::string() : toml_word(node);
      const char* end = word.data() + word.size();
      const auto [stop, error] = std::from_chars(word.data(), end, value);
      if (error != std::errc() || stop != end) return std::nullopt;
    }
    ConfigRange range = range_;
    if constexpr (std::is_same_v<T, float>) {  // the bounds themselves are allowed
      range.low = static_cast<double>(static_cast<float>(range.low));
      range.high = static_cast<double>(static_cast<float>(range.high));
    }
    if (!range.holds(static_cast<double>(value))) return std::nullopt;
    return value;
  }
  template <class T>
  [[nodiscard]] std::optional<std::vector<T>> array(std::size_t size) const {
    const toml::array* values = value_.as_array();
    if (values == nullptr || values->size() != size) return std::nullopt;
    std::vector<T> result;
    for (const toml::node& one : *values) {
      const std::optional<T> number = parse<T>(one);
      if (!number) return std::nullopt;
      result.push_back(*number);
    }
    return result;
  }
  [[nodiscard]] std::optional<std::vector<std::string>> strings() const {
    if (!value_.is_array()) return std::nullopt;
    std::vector<std::string> result;
    for (const toml::node& one : *value_.as_array()) {
      if (!one.is_string()) return std::nullopt;
      result.push_back(toml_word(one));
    }
    return result;
  }

  const toml::node& value_;
  const ConfigRange& range_;
};

}  // namespace

bool ConfigRange::holds(double value) const {
  return std::isfinite(value) && value <= high && (above ? value > low : value >= low);
}

std::string ConfigRange::text() const {
  if (std::isfinite(high)) return fmt::format("{} to {}", low, high);
  if (!std::isfinite(low)) return {};
  return above ? fmt::format("above {}", low) : fmt::format("{} or more", low);
}

std::string config_text(const ConfigField& field) {
  return std::visit(ConfigText{}, field.value);
}

std::string set_config(ConfigField& field, const toml::node& value) {
  const std::string expected = std::visit(ConfigSetter(value, field.range), field.value);
  return expected.empty() ? expected : fmt::format("expected {}, not {}", expected, toml_text(value));
}

std::string set_config(ConfigField& field, std::string_view text) {
  try {
    const TomlFile toml = read_toml("value = " + std::string(text), field.name());
    const toml::node* value = toml.root.get("value");
    return value == nullptr || toml.entries.size() != 1 ? "expected one value" : set_config(field, *value);
  } catch (const InputError& error) {
    return error.what();
  }
}

}  // namespace dynslam::runtime
