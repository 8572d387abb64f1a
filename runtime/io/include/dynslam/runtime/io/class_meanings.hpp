// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <string>
#include <vector>

#include "dynslam/runtime/io/map_classes.hpp"

namespace dynslam::runtime {

/// What a class of a network or of label images is used for.
struct ClassMeaning {
  bool dynamic = false;    ///< moves by itself
  std::uint8_t label = 0;  ///< of the map; 0: none
};

/// What each class is used for.
/// @param names            of the classes, by their number; empty names have none
/// @param dynamic_classes  that move by themselves
/// @param map_classes      that the map labels; empty: those of chair, tv, tvmonitor, display there are
/// @param labels           that the map has so far; `map_classes` may add to them
/// @param whose            has these classes, for messages: "the model"
/// @throws UsageError for a class that is not among the names, or where the map has no label left
[[nodiscard]] std::vector<ClassMeaning> class_meanings(const std::vector<std::string>& names,
                                                       const std::vector<std::string>& dynamic_classes,
                                                       const std::vector<std::string>& map_classes,
                                                       const MapClasses& labels, const std::string& whose);

/// In words: "dynamic: person; labels of the map: chair (2), pallet (4)".
[[nodiscard]] std::string describe_meanings(const std::vector<std::string>& names,
                                            const std::vector<ClassMeaning>& meanings);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
