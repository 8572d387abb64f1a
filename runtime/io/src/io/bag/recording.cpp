// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/recording.hpp"

#include <fmt/format.h>

#include <string_view>

namespace dynslam::runtime::bag {

std::string plain_type(const std::string& type) {
  constexpr std::string_view kMiddle = "/msg/";
  const auto at = type.find(kMiddle);
  return at == std::string::npos ? type : type.substr(0, at + 1) + type.substr(at + kMiddle.size());
}

std::string where_in_file(const std::string& file, const std::string& topic, const Place& place) {
  return fmt::format("{}: {}, message at byte {}{}", file, topic, place.at,
                     place.chunk > 0 ? fmt::format(" of the chunk at byte {}", place.chunk) : "");
}

}  // namespace dynslam::runtime::bag
