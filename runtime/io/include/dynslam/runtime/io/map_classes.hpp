// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/semantic/label_histogram.hpp"

namespace dynslam::runtime {

/// Names of the map's labels: background, person, chair and display, and the user's own classes behind them.
class MapClasses {
 public:
  /// Label of a class, display for every kind of screen; nullopt: the map has none of that name.
  [[nodiscard]] std::optional<std::uint8_t> find(std::string_view name) const;
  /// The same, or the next label that is free.
  /// @throws UsageError where none is, or the name is no line of text
  std::uint8_t add(const std::string& name);
  /// Takes over a name that a saved map has for a label; false where another one has it already or the name
  /// is no line of text.
  bool set(std::uint8_t label, const std::string& name);
  /// "background", "person", "chair", "display", an own name, or "label N".
  [[nodiscard]] std::string name(std::uint8_t label) const;
  /// Whether a label has a name of the user's own.
  [[nodiscard]] bool own(std::uint8_t label) const;
  /// Whether any has.
  [[nodiscard]] bool any_own() const;

  bool operator==(const MapClasses&) const = default;

 private:
  std::array<std::string, kMapLabels> own_;  // by label; empty: none
};

/// The same with the labels that these classes take.
/// @throws UsageError where the map has not enough
[[nodiscard]] MapClasses with_classes(MapClasses classes, const std::vector<std::string>& names);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
