// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
#include <concepts>
#include <type_traits>

#ifdef __SSE2__
#include <immintrin.h>
#endif

// Kernels that gain by wider vectors than the compiler may take are compiled a second time, for AVX2, which
// is taken where the processor has it. The results are the same bits: what is done is done to each number by
// itself, and products are not fused with sums (the second version has no FMA).
//
// `DYNSLAM_WIDE_VECTORS` defined as 0 leaves that version out. Without it there is one with g++ and clang on
// x86-64, unless all of the program is compiled for AVX2.
#ifndef DYNSLAM_WIDE_VECTORS
#if defined(__GNUC__) && defined(__x86_64__) && !defined(__AVX2__)
#define DYNSLAM_WIDE_VECTORS 1
#else
#define DYNSLAM_WIDE_VECTORS 0
#endif
#endif

#if DYNSLAM_WIDE_VECTORS
#define DYNSLAM_FOR_AVX2 __attribute__((target("avx2")))
#else
#define DYNSLAM_FOR_AVX2
#endif

/// Of a function or lambda that must be a part of its caller, to be compiled for what the caller is compiled
/// for.
#ifdef __GNUC__
#define DYNSLAM_ALWAYS_INLINE __attribute__((always_inline))
#else
#define DYNSLAM_ALWAYS_INLINE
#endif

namespace dynslam::detail {

/// Whether with_wide_vectors() has wider ones here.
[[nodiscard]] inline bool has_wide_vectors() {
#if DYNSLAM_WIDE_VECTORS
  return __builtin_cpu_supports("avx2") != 0;
#else
  return false;
#endif
}

template <class F, class... Args>
DYNSLAM_FOR_AVX2 void call_for_avx2(const F& f, Args&... args) {
  f(args...);
}

/// Calls f(args...) with the widest vectors of the processor.
/// @param f     `[](auto&... args) DYNSLAM_ALWAYS_INLINE { ... }`; so must be what it calls, or that stays as
///              it was
/// @param args  by reference and not as captures, behind which compilers see less
template <class F, class... Args>
void with_wide_vectors(const F& f, Args&... args) {
  if (has_wide_vectors()) {
    call_for_avx2(f, args...);
  } else {
    f(args...);
  }
}

#if DYNSLAM_WIDE_VECTORS || defined(__AVX2__)
template <int N, std::floating_point S>
DYNSLAM_FOR_AVX2 inline void square_roots_for_avx2(const S* x, S* root) {
  int i = 0;
  if constexpr (std::is_same_v<S, double>) {
    for (; i + 4 <= N; i += 4) _mm256_storeu_pd(root + i, _mm256_sqrt_pd(_mm256_loadu_pd(x + i)));
  } else if constexpr (std::is_same_v<S, float>) {
    for (; i + 8 <= N; i += 8) _mm256_storeu_ps(root + i, _mm256_sqrt_ps(_mm256_loadu_ps(x + i)));
  }
  for (; i < N; ++i) root[i] = std::sqrt(x[i]);
}
#endif

/// Square roots of N numbers >= 0, correctly rounded: of std::sqrt, which may set errno, compilers make no
/// vectors.
template <int N, std::floating_point S>
void square_roots(const S* x, S* root) {
  int i = 0;
#ifdef __AVX2__
  square_roots_for_avx2<N>(x, root);
  i = N;
#elif DYNSLAM_WIDE_VECTORS
  if (N > 1 && has_wide_vectors()) {
    square_roots_for_avx2<N>(x, root);
    i = N;
  }
#endif
#ifdef __SSE2__
  if constexpr (std::is_same_v<S, double>) {
    for (; i + 2 <= N; i += 2) _mm_storeu_pd(root + i, _mm_sqrt_pd(_mm_loadu_pd(x + i)));
  } else if constexpr (std::is_same_v<S, float>) {
    for (; i + 4 <= N; i += 4) _mm_storeu_ps(root + i, _mm_sqrt_ps(_mm_loadu_ps(x + i)));
  }
#endif
  for (; i < N; ++i) root[i] = std::sqrt(x[i]);
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
