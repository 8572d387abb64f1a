// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <concepts>
#include <cstdint>

#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// N neighbouring pixels as numbers to calculate with.
/// @param p  the first of N readable pixels
template <Scalar S, int N, class P>
[[nodiscard]] Eigen::Array<S, N, 1> widen(const P* p) {
  Eigen::Array<S, N, 1> out;
#ifdef EIGEN_VECTORIZE_SSE2
  // Bytes to floats is the inner loop of patch alignment, and compilers do it one by one.
  if constexpr (std::same_as<S, float> && std::same_as<P, std::uint8_t> && N == 8) {
    const __m128i zero = _mm_setzero_si128();
    const __m128i words = _mm_unpacklo_epi8(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)), zero);
    _mm_storeu_ps(out.data(), _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, zero)));
    _mm_storeu_ps(out.data() + 4, _mm_cvtepi32_ps(_mm_unpackhi_epi16(words, zero)));
    return out;
  }
#endif
  for (int i = 0; i < N; ++i) out[i] = static_cast<S>(p[i]);
  return out;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
