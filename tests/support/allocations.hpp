// SPDX-License-Identifier: BSD-3-Clause
// Counts what is taken from the heap, so that "allocates nothing" can fail.
#pragma once

#include <cstddef>
#include <utility>

namespace dynslam::test {

/// Blocks that this thread has taken from the heap since it started: by operator new, by Eigen's own aligned
/// memory and by malloc itself, all of which end in the same place (allocations.cpp).
[[nodiscard]] std::size_t allocations();

/// Whether this build can count: not without glibc or a sanitizer's hooks.
[[nodiscard]] bool counts_allocations();

/// Blocks that `f` takes.
template <class F>
[[nodiscard]] std::size_t allocations_of(F&& f) {
  const std::size_t before = allocations();
  std::forward<F>(f)();
  return allocations() - before;
}

}  // namespace dynslam::test
