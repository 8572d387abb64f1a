// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/class_meanings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime {

std::vector<ClassMeaning> class_meanings(const std::vector<std::string>& names,
                                         const std::vector<std::string>& dynamic_classes,
                                         const std::vector<std::string>& map_classes,
                                         const MapClasses& labels, const std::string& whose) {
  std::vector<ClassMeaning> meanings(names.size());
  const auto has = [&](const std::string& name) {
    return !name.empty() && std::find(names.begin(), names.end(), name) != names.end();
  };
  const auto for_each = [&](const std::string& name, auto&& use) {
    if (!has(name)) {
      std::string known;
      for (const auto& c : names) known += c.empty() ? "" : (known.empty() ? "" : ", ") + c;
      throw UsageError(fmt::format("{} has no class '{}'; it has: {}", whose, name, known));
    }
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == name) use(meanings[i]);
  };
  for (const std::string& name : dynamic_classes) {
    for_each(name, [&](ClassMeaning& m) {
      m.dynamic = true;
      m.label = static_cast<std::uint8_t>(name == "person" ? Label::person : Label::background);
    });
  }
  std::vector<std::string> mapped = map_classes;
  if (mapped.empty()) {
    for (const char* name : {"chair", "tv", "tvmonitor", "display"})
      if (has(name)) mapped.emplace_back(name);
  }
  MapClasses known = labels;
  for (const std::string& name : mapped) {
    const std::uint8_t label = known.add(name);
    if (label <= static_cast<std::uint8_t>(Label::person))
      throw UsageError(fmt::format("--map-classes {}: is no class of the map", name));
    for_each(name, [&](ClassMeaning& m) {
      if (!m.dynamic) m.label = label;
    });
  }
  return meanings;
}

std::string describe_meanings(const std::vector<std::string>& names,
                              const std::vector<ClassMeaning>& meanings) {
  std::string dynamic, mapped;
  const auto append = [](std::string& text, const std::string& part) {
    text += (text.empty() ? "" : ", ") + part;
  };
  for (std::size_t i = 0; i < meanings.size(); ++i) {
    if (meanings[i].dynamic) append(dynamic, names[i]);
    if (!meanings[i].dynamic && meanings[i].label != 0)
      append(mapped, fmt::format("{} ({})", names[i], meanings[i].label));
  }
  return fmt::format("dynamic: {}; labels of the map: {}", dynamic.empty() ? "none" : dynamic,
                     mapped.empty() ? "none" : mapped);
}

}  // namespace dynslam::runtime
