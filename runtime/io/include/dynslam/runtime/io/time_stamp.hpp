// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace dynslam::runtime {

/// A time as computations have it, and as it was recorded: seconds since 1970 in double are multiples of 238
/// ns.
struct TimeStamp {
  double t = 0;         ///< [s]
  std::int64_t ns = 0;  ///< the same in nanoseconds; 0: unknown
};

/// The time that a word says: seconds with any number of decimals (nanoseconds are kept, more is rounded), or
/// 19 digits, which are nanoseconds since 1970. nullopt for what is no finite number.
[[nodiscard]] std::optional<TimeStamp> parse_time(std::string_view word);
/// The time of so many nanoseconds.
[[nodiscard]] TimeStamp time_of(std::int64_t ns);
/// Seconds with 9 decimals, all of them exact.
[[nodiscard]] std::string nanosecond_text(std::int64_t ns);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
