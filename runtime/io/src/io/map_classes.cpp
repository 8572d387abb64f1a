// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_classes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::array<std::string_view, 4> kFixed{"background", "person", "chair", "display"};
constexpr std::array<std::string_view, 4> kDisplays{"tv", "tvmonitor", "monitor", "laptop"};

/// Names stand in lines of text, JSON and tables.
bool is_line(const std::string& name) {
  constexpr std::size_t kLongest = 64;
  return !name.empty() && name.size() <= kLongest && std::none_of(name.begin(), name.end(), [](char c) {
    return static_cast<unsigned char>(c) < ' ' || c == '\x7f';
  });
}

}  // namespace

std::optional<std::uint8_t> MapClasses::find(std::string_view name) const {
  for (std::size_t label = 0; label < kFixed.size(); ++label)
    if (name == kFixed[label]) return static_cast<std::uint8_t>(label);
  if (std::find(kDisplays.begin(), kDisplays.end(), name) != kDisplays.end())
    return static_cast<std::uint8_t>(Label::display);
  for (std::size_t label = kFixed.size(); label < own_.size(); ++label)
    if (!own_[label].empty() && own_[label] == name) return static_cast<std::uint8_t>(label);
  return std::nullopt;
}

std::uint8_t MapClasses::add(const std::string& name) {
  if (const auto known = find(name)) return *known;
  if (!is_line(name)) throw UsageError(fmt::format("a class of the map has no name that is a line of text"));
  for (std::size_t label = kFixed.size(); label < own_.size(); ++label) {
    if (!own_[label].empty()) continue;
    own_[label] = name;
    return static_cast<std::uint8_t>(label);
  }
  std::string names;
  for (std::size_t label = kFixed.size(); label < own_.size(); ++label) names += own_[label] + ", ";
  throw UsageError(fmt::format(
      "the map has no label left for the class '{}': beside {}chair and display it has none", name, names));
}

bool MapClasses::set(std::uint8_t label, const std::string& name) {
  if (label < kFixed.size() || label >= own_.size() || !is_line(name)) return false;
  if (!own_[label].empty()) return own_[label] == name;
  if (find(name)) return false;
  own_[label] = name;
  return true;
}

std::string MapClasses::name(std::uint8_t label) const {
  if (label < kFixed.size()) return std::string(kFixed[label]);
  return own(label) ? own_[label] : fmt::format("label {}", label);
}

bool MapClasses::own(std::uint8_t label) const {
  return label < own_.size() && !own_[label].empty();
}

bool MapClasses::any_own() const {
  return *this != MapClasses();
}

MapClasses with_classes(MapClasses classes, const std::vector<std::string>& names) {
  for (const std::string& name : names) (void)classes.add(name);
  return classes;
}

}  // namespace dynslam::runtime
