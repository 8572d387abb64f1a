// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dynslam::runtime {

/// Bytes as text (RFC 4648, with padding).
[[nodiscard]] std::string to_base64(std::span<const std::uint8_t> bytes);
/// The bytes of such a text; nullopt where it is none.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> from_base64(std::string_view text);

}  // namespace dynslam::runtime
