// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/image_row.hpp"

// Rows of masks as bits, 64 pixels a word, and as runs: what masks of surfaces are made of, and what connects
// them at a cost per run instead of per pixel.

namespace dynslam {

/// Neighbouring pixels of a row: [begin, end) of row v.
struct PixelRun {
  int v, begin, end;
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(end - begin); }
};

namespace detail {
inline constexpr int kWordPixels = 64;

/// Words that a row of so many pixels takes.
[[nodiscard]] constexpr std::size_t words_of_row(int pixels) {
  return (static_cast<std::size_t>(pixels) + kWordPixels - 1) / kWordPixels;
}

/// The bits of a row's last word that are pixels of it.
[[nodiscard]] constexpr std::uint64_t last_word(int pixels) {
  return ~std::uint64_t{0} >> ((kWordPixels - pixels % kWordPixels) % kWordPixels);
}

/// Bit i is set where byte i is 255; 16 bytes that are 0 or 255.
[[nodiscard]] inline std::uint64_t bits_of_bytes(const std::uint8_t* bytes) {
#ifdef EIGEN_VECTORIZE_SSE2
  const __m128i part = _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes));
  return static_cast<unsigned>(_mm_movemask_epi8(part));
#else
  std::uint64_t bits = 0;
  for (int k = 0; k < 16; k += 8) {
    std::uint64_t part = 0;
    if constexpr (std::endian::native == std::endian::little) {
      std::memcpy(&part, bytes + k, 8);
    } else {
      for (int i = 0; i < 8; ++i) part |= static_cast<std::uint64_t>(bytes[k + i]) << (8 * i);
    }
    // Moves the lowest bit of byte i to bit i of the highest byte.
    bits |= ((part & 0x0101010101010101U) * 0x0102040810204080U >> 56) << k;
  }
  return bits;
#endif
}

/// Bits of the nonzero ones of the pixels [u, u + n) of a row, n <= 64.
template <class Row>
[[nodiscard]] std::uint64_t nonzero_bits(const Row& row, int u, int n) {
  std::array<std::uint8_t, kWordPixels> bytes;
  const auto byte = [&](int i) { return static_cast<std::uint8_t>(row[u + i] != 0 ? 255 : 0); };
  if (n == kWordPixels) {
    for (int i = 0; i < kWordPixels; ++i) bytes[static_cast<std::size_t>(i)] = byte(i);
  } else {
    bytes.fill(0);
    for (int i = 0; i < n; ++i) bytes[static_cast<std::size_t>(i)] = byte(i);
  }
  std::uint64_t bits = 0;
  for (int k = 0; k < kWordPixels; k += 16) bits |= bits_of_bytes(bytes.data() + k) << k;
  return bits;
}

/// Bits of a whole row of w pixels, nonzero ones set; those beyond the row are 0.
template <class Row>
void row_to_bits(const Row& row, int w, std::uint64_t* bits) {
  for (int u = 0; u < w; u += kWordPixels)
    *bits++ = nonzero_bits(row, u, w - u < kWordPixels ? w - u : kWordPixels);
}

/// Sets the pixels [begin, end) of a row.
template <class Row, class Pixel>
void fill_row(Row& row, int begin, int end, Pixel value) {
  if constexpr (std::is_pointer_v<Row>) {
    std::fill(row + begin, row + end, value);
  } else {
    for (int u = begin; u < end; ++u) row[u] = value;
  }
}

/// Writes `set` where a bit is set and 0 elsewhere, a whole row of w pixels.
template <class Pixel, class Row>
void bits_to_row(const std::uint64_t* bits, int w, Pixel set, Row row) {
  constexpr bool kBytes =
      std::is_pointer_v<Row> && sizeof(Pixel) == 1 && std::endian::native == std::endian::little;
  for (int u = 0; u < w; u += kWordPixels) {
    const std::uint64_t word = *bits++;
    const int n = w - u < kWordPixels ? w - u : kWordPixels;
    if (word == 0 || ~word == 0) {  // most of what surfaces are
      fill_row(row, u, u + n, word == 0 ? Pixel(0) : set);
    } else if (kBytes && n == kWordPixels) {
      if constexpr (kBytes) {
        for (int k = 0; k < kWordPixels; k += 8) {
          // Bit i, alone in byte i, is carried to the byte's highest bit, and makes the byte 1.
          std::uint64_t bytes = (word >> k & 0xff) * 0x0101010101010101U & 0x8040201008040201U;
          bytes = ((bytes + 0x7f7f7f7f7f7f7f7fU) >> 7 & 0x0101010101010101U) * static_cast<std::uint8_t>(set);
          std::memcpy(row + u + k, &bytes, 8);
        }
      }
    } else {
      for (int i = 0; i < n; ++i) row[u + i] = (word >> i & 1) != 0 ? set : Pixel(0);
    }
  }
}

/// Calls f(begin, end) for each run of set bits, from the first on.
/// @param w  pixels of the row; bits beyond are 0
template <class F>
void for_runs(const std::uint64_t* bits, int w, const F& f) {
  int begin = -1;
  std::uint64_t before = 0;  // the last bit of the word before
  for (int u = 0; u < w; u += kWordPixels) {
    const std::uint64_t word = *bits++;
    std::uint64_t edges = word ^ (word << 1 | before);
    before = word >> (kWordPixels - 1);
    for (; edges != 0; edges &= edges - 1) {
      const int at = u + std::countr_zero(edges);
      if (begin < 0) {
        begin = at;
      } else {
        f(begin, at);
        begin = -1;
      }
    }
  }
  if (begin >= 0) f(begin, w);
}

/// Sets the pixels of a run.
template <class I, class Pixel>
void fill_run(I& image, PixelRun run, Pixel value) {
  auto row = image_row(image, run.v);
  fill_row(row, run.begin, run.end, value);
}
}  // namespace detail

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
