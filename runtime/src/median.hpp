// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace dynslam::runtime {

/// The middle one of values, of an even number the upper; 0 of none. Their order is lost.
template <class T>
[[nodiscard]] T median_of(std::vector<T>& values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace dynslam::runtime
