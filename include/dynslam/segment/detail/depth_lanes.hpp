// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

// Depths that are compared several at once, by the vectors of g++ and clang; one at a time with other
// compilers or scalars.

namespace dynslam::detail {

template <std::floating_point S>
struct DepthLanes {
  using Vector = S;
  using Mask = bool;
  static constexpr int kCount = 1;
};
#ifdef __GNUC__
template <>
struct DepthLanes<float> {
  typedef float Vector __attribute__((vector_size(16)));
  typedef std::int32_t Mask __attribute__((vector_size(16)));  // of a comparison: 0 or -1
  static constexpr int kCount = 4;
};
template <>
struct DepthLanes<double> {
  typedef double Vector __attribute__((vector_size(16)));
  typedef std::int64_t Mask __attribute__((vector_size(16)));
  static constexpr int kCount = 2;
};
#endif

template <std::floating_point S>
[[nodiscard]] typename DepthLanes<S>::Vector load_lanes(const S* z) {
  typename DepthLanes<S>::Vector lanes;
  std::memcpy(&lanes, z, sizeof(lanes));
  return lanes;
}

/// |x|, of numbers as of vectors.
template <class V>
[[nodiscard]] V magnitude(const V& x) {
  if constexpr (std::floating_point<V>) {
    return std::abs(x);
  } else if constexpr (sizeof(x[0]) == sizeof(float)) {
    return std::bit_cast<V>(std::bit_cast<DepthLanes<float>::Mask>(x) &
                            std::numeric_limits<std::int32_t>::max());
  } else {
    return std::bit_cast<V>(std::bit_cast<DepthLanes<double>::Mask>(x) &
                            std::numeric_limits<std::int64_t>::max());
  }
}
template <class V>
[[nodiscard]] V smaller(const V& a, const V& b) {
  return b < a ? b : a;
}

/// Bit i is set where the comparison of lane i was true.
template <std::floating_point S>
[[nodiscard]] unsigned bits_of_lanes(const typename DepthLanes<S>::Mask& mask) {
  if constexpr (DepthLanes<S>::kCount == 1) {
    return mask ? 1 : 0;
  } else {
#ifdef EIGEN_VECTORIZE_SSE2
    if constexpr (DepthLanes<S>::kCount == 4) {
      return static_cast<unsigned>(_mm_movemask_ps(std::bit_cast<__m128>(mask)));
    } else {
      return static_cast<unsigned>(_mm_movemask_pd(std::bit_cast<__m128d>(mask)));
    }
#else
    unsigned bits = 0;
    for (int i = 0; i < DepthLanes<S>::kCount; ++i) bits |= static_cast<unsigned>(mask[i] & 1) << i;
    return bits;
#endif
  }
}

/// Depths that are compared before the answers become bits.
inline constexpr int kPartPixels = 16;

/// Bit i is set where `compare(i)`, of the lanes from pixel i on, was true, i < 16.
template <std::floating_point S, class Compare>
[[nodiscard]] std::uint64_t bits_of_part(const Compare& compare) {
#ifdef EIGEN_VECTORIZE_SSE2
  // Masks are narrowed to bytes, of which one instruction makes bits.
  const auto mask = [&](int i) { return std::bit_cast<__m128i>(compare(i)); };
  if constexpr (DepthLanes<S>::kCount == 4) {
    const __m128i low = _mm_packs_epi32(mask(0), mask(4)), high = _mm_packs_epi32(mask(8), mask(12));
    return static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
  } else if constexpr (DepthLanes<S>::kCount == 2) {
    const auto four = [&](int i) { return _mm_packs_epi32(mask(i), mask(i + 2)); };
    const __m128i low = _mm_packs_epi32(four(0), four(4)), high = _mm_packs_epi32(four(8), four(12));
    return static_cast<unsigned>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
  }
#endif
  std::uint64_t bits = 0;
  for (int i = 0; i < kPartPixels; i += DepthLanes<S>::kCount)
    bits |= static_cast<std::uint64_t>(bits_of_lanes<S>(compare(i))) << i;
  return bits;
}

/// The rule of is_valid_depth().
template <std::floating_point S>
[[nodiscard]] typename DepthLanes<S>::Mask valid_lanes(const typename DepthLanes<S>::Vector& z) {
  return (z > S(0)) & (z <= std::numeric_limits<S>::max());
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
