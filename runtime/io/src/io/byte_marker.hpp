// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

namespace dynslam::runtime {

/// Whether a file begins with the bytes that tell its kind.
template <class Marker>
[[nodiscard]] bool starts_with(std::span<const std::uint8_t> bytes, const Marker& marker) {
  return bytes.size() >= marker.size() && std::equal(marker.begin(), marker.end(), bytes.begin());
}

}  // namespace dynslam::runtime
