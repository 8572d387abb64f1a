// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdlib>

/// The state of a precondition check.
///
/// `DYNSLAM_ASSERT(condition, message)` states a precondition of a function. A broken precondition is a
/// mistake in the calling program, never a property of its data: data that cannot be used are answered
/// with an empty optional or a status value.
///
/// - `DYNSLAM_ENABLE_ASSERTS` defined as 1 checks, defined as 0 does not. Without it the checks follow
///   NDEBUG, as `assert` does. It must have the same value in all translation units of a program.
/// - A failed check calls `DYNSLAM_ASSERT_HANDLER(condition_text, message, file, line)`, a macro that a
///   program may define before the first include. The default is `dynslam::assertion_failed`, which
///   calls std::abort() and prints nothing: the core never prints.
#ifndef DYNSLAM_ENABLE_ASSERTS
#ifdef NDEBUG
#define DYNSLAM_ENABLE_ASSERTS 0
#else
#define DYNSLAM_ENABLE_ASSERTS 1
#endif
#endif

namespace dynslam {

/// Default handler of a broken precondition: stops the program. The arguments are there to be read in a
/// debugger.
[[noreturn]] inline void assertion_failed(const char* /*condition*/, const char* /*message*/,
                                          const char* /*file*/, int /*line*/) {
  std::abort();
}

namespace detail {
/// Asks for memory that is read soon, where compilers can; nothing else comes of it.
inline void prefetch([[maybe_unused]] const void* address) {
#ifdef __GNUC__
  __builtin_prefetch(address);
#endif
}
/// The same of all of an object.
template <class T>
void prefetch_object(const T& object) {
  constexpr std::size_t kLine = 64;  // bytes that come at once
  for (std::size_t at = 0; at < sizeof(T); at += kLine) prefetch(reinterpret_cast<const char*>(&object) + at);
}
}  // namespace detail

}  // namespace dynslam

#ifndef DYNSLAM_ASSERT_HANDLER
#define DYNSLAM_ASSERT_HANDLER(condition, message, file, line) \
  ::dynslam::assertion_failed(condition, message, file, line)
#endif

#if DYNSLAM_ENABLE_ASSERTS
#define DYNSLAM_ASSERT(condition, message) \
  (static_cast<bool>(condition)            \
       ? static_cast<void>(0)              \
       : static_cast<void>(DYNSLAM_ASSERT_HANDLER(#condition, message, __FILE__, __LINE__)))
#else
/// sizeof: the condition is compiled, so that it cannot rot, and never evaluated.
#define DYNSLAM_ASSERT(condition, message) static_cast<void>(sizeof(static_cast<bool>(condition)))
#endif

/// Before a function whose result refers to an object or a workspace that the caller keeps: g++ 14 would take
/// it for a reference to one of the temporaries among the arguments (-Wdangling-reference).
#ifdef __has_cpp_attribute
#if __has_cpp_attribute(gnu::no_dangling)
#define DYNSLAM_NO_DANGLING [[gnu::no_dangling]]
#endif
#endif
#ifndef DYNSLAM_NO_DANGLING
#define DYNSLAM_NO_DANGLING
#endif

#include "dynslam/pop_macros.hpp"
