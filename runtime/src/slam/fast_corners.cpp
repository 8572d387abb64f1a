// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/fast_corners.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "dynslam/config.hpp"

namespace dynslam::runtime {
namespace {

constexpr int kWidest = 32;  // pixels that are looked at together, where the processor can

/// So many neighbouring pixels, in a register and anywhere in a row.
template <int N>
struct PixelLanes {
  typedef std::uint8_t Vector __attribute__((vector_size(N)));
  typedef std::uint8_t Stored __attribute__((vector_size(N), aligned(1), may_alias));
};

using RingOffsets = std::array<std::ptrdiff_t, 16>;

/// A row of pixels and where their scores go, by the column of the image.
struct FastRow {
  const std::uint8_t* grey;
  std::uint8_t* score;
  int begin, end;  // columns
  int last;        // the last column from which lanes may begin
  int threshold;
};

// All of this is compiled once per kind of processor: references, for a vector that is handed over by value
// goes another way on each.
template <class V>
[[gnu::always_inline]] inline void load_pixels(const std::uint8_t* from, V& out) {
  out = *reinterpret_cast<const typename PixelLanes<sizeof(V)>::Stored*>(from);
}
template <class V>
[[gnu::always_inline]] inline void store_pixels(const V& pixels, std::uint8_t* to) {
  *reinterpret_cast<typename PixelLanes<sizeof(V)>::Stored*>(to) = pixels;
}
template <class V>
[[gnu::always_inline]] inline void take_smaller(const V& x, V& out) {
  out = out < x ? out : x;
}
template <class V>
[[gnu::always_inline]] inline void take_larger(const V& x, V& out) {
  out = out > x ? out : x;
}
template <class V>
[[gnu::always_inline]] inline bool any_nonzero(const V& x) {
  std::array<std::uint64_t, sizeof(V) / 8> words;
  std::memcpy(words.data(), &x, sizeof(V));
  std::uint64_t any = 0;
  for (const std::uint64_t w : words) any |= w;
  return any != 0;
}

/// How far the centres are below `bright` or above `dark`, whichever is farther; 0: neither.
template <class V>
[[gnu::always_inline]] inline void contrast(const V& centre, const V& bright, const V& dark, V& out) {
  V below = centre, above = centre;
  take_larger(bright, below);
  take_smaller(dark, above);
  below -= centre;
  above = centre - above;
  out = below > above ? below : above;
}

/// Nine in a row contain one of each two opposite pixels of the ring: an upper bound of the score.
template <class V>
[[gnu::always_inline]] inline void bound_scores(const V& centre, const std::array<V, 16>& ring, V& out) {
  V bright = ring[0], dark = ring[0];
  take_larger(ring[8], bright);
  take_smaller(ring[8], dark);
  for (const std::size_t k : {4U, 2U, 6U}) {
    V larger = ring[k], smaller = ring[k];
    take_larger(ring[k + 8], larger);
    take_smaller(ring[k + 8], smaller);
    take_smaller(larger, bright);
    take_larger(smaller, dark);
  }
  contrast(centre, bright, dark, out);
}

/// The brightest of the darkest pixels of nine in a row, and the darkest of the brightest ones.
template <class V>
[[gnu::always_inline]] inline void exact_scores(const V& centre, const std::array<V, 16>& ring, V& out) {
  std::array<V, 8> low2, high2;  // of two pixels from 2 k + 1 on
  for (std::size_t k = 0; k < 8; ++k) {
    low2[k] = high2[k] = ring[2 * k + 1];
    take_smaller(ring[(2 * k + 2) % 16], low2[k]);
    take_larger(ring[(2 * k + 2) % 16], high2[k]);
  }
  std::array<V, 8> low4 = low2, high4 = high2;
  for (std::size_t k = 0; k < 8; ++k) {
    take_smaller(low2[(k + 1) % 8], low4[k]);
    take_larger(high2[(k + 1) % 8], high4[k]);
  }
  V bright{}, dark = ~bright;
  for (std::size_t k = 0; k < 8; ++k) {
    // Eight pixels, and with them the one before or the one behind.
    V low = low4[k], high = high4[k], ends_high = ring[2 * k], ends_low = ring[2 * k];
    take_smaller(low4[(k + 2) % 8], low);
    take_larger(high4[(k + 2) % 8], high);
    take_larger(ring[(2 * k + 9) % 16], ends_high);
    take_smaller(ring[(2 * k + 9) % 16], ends_low);
    take_smaller(ends_high, low);
    take_larger(ends_low, high);
    take_larger(low, bright);
    take_smaller(high, dark);
  }
  contrast(centre, bright, dark, out);
}

template <int N>
[[gnu::always_inline]] inline void score_pixels(const FastRow& row, const RingOffsets& offsets) {
  using V = typename PixelLanes<N>::Vector;
  const V threshold = V{} + static_cast<std::uint8_t>(row.threshold), one = V{} + std::uint8_t{1};
  for (int at = row.begin; at < row.end; at += N) {
    const int u = std::min(at, row.last);
    V centre, score;
    std::array<V, 16> ring;
    load_pixels(row.grey + u, centre);
    for (std::size_t k = 0; k < 16; k += 2) load_pixels(row.grey + u + offsets[k], ring[k]);
    bound_scores(centre, ring, score);
    score = score > threshold ? score : V{};
    if (any_nonzero(score)) {
      for (std::size_t k = 1; k < 16; k += 2) load_pixels(row.grey + u + offsets[k], ring[k]);
      exact_scores(centre, ring, score);
      score = score > threshold ? score - one : V{};
    }
    store_pixels(score, row.score + u);
  }
}

/// @param above, below  scores of the rows around; @param kept  the scores that are larger than all around
template <int N>
[[gnu::always_inline]] inline void keep_largest(const FastRow& row, const std::uint8_t* above,
                                                const std::uint8_t* below, std::uint8_t* kept) {
  using V = typename PixelLanes<N>::Vector;
  for (int u = row.begin; u < row.end; u += N) {
    V score, around, other;
    load_pixels(row.score + u, score);
    if (!any_nonzero(score)) {
      store_pixels(score, kept + u);
      continue;
    }
    load_pixels(row.score + u - 1, around);
    load_pixels(row.score + u + 1, other);
    take_larger(other, around);
    for (const std::uint8_t* neighbours : {above, below}) {
      for (const int d : {-1, 0, 1}) {
        load_pixels(neighbours + u + d, other);
        take_larger(other, around);
      }
    }
    score = score > around ? score : V{};
    store_pixels(score, kept + u);
  }
}

void score_row(const FastRow& row, const RingOffsets& offsets) {
  score_pixels<16>(row, offsets);
}
void keep_row(const FastRow& row, const std::uint8_t* above, const std::uint8_t* below, std::uint8_t* kept) {
  keep_largest<16>(row, above, below, kept);
}
#ifdef __x86_64__
[[gnu::target("avx2")]] void score_row_wide(const FastRow& row, const RingOffsets& offsets) {
  score_pixels<kWidest>(row, offsets);
}
[[gnu::target("avx2")]] void keep_row_wide(const FastRow& row, const std::uint8_t* above,
                                           const std::uint8_t* below, std::uint8_t* kept) {
  keep_largest<kWidest>(row, above, below, kept);
}
bool has_wide_rows() {
  static const bool has = __builtin_cpu_supports("avx2") != 0;
  return has;
}
#else
constexpr auto score_row_wide = score_row;
constexpr auto keep_row_wide = keep_row;
constexpr bool has_wide_rows() {
  return false;
}
#endif

RingOffsets ring_offsets(std::ptrdiff_t step) {
  constexpr std::array<std::array<int, 2>, 16> kOffsets{{{0, 3},
                                                         {1, 3},
                                                         {2, 2},
                                                         {3, 1},
                                                         {3, 0},
                                                         {3, -1},
                                                         {2, -2},
                                                         {1, -3},
                                                         {0, -3},
                                                         {-1, -3},
                                                         {-2, -2},
                                                         {-3, -1},
                                                         {-3, 0},
                                                         {-3, 1},
                                                         {-2, 2},
                                                         {-1, 3}}};
  RingOffsets offsets;
  for (std::size_t k = 0; k < 16; ++k) offsets[k] = kOffsets[k][0] + step * kOffsets[k][1];
  return offsets;
}

void list_corners(const std::uint8_t* kept, int begin, int end, int v, std::vector<FastCorner>& out) {
  for (int u = begin; u < end; u += 8) {
    std::uint64_t word;
    std::memcpy(&word, kept + u, 8);
    if (word == 0) continue;
    for (int x = u; x < std::min(u + 8, end); ++x) {
      if (kept[x] != 0) out.push_back({x, v, kept[x]});
    }
  }
}

}  // namespace

void FastCorners::find(const cv::Mat& image, const cv::Rect& part, int threshold,
                       std::vector<FastCorner>& out) {
  const int right = part.x + part.width, bottom = part.y + part.height;
  DYNSLAM_ASSERT(image.type() == CV_8UC1 && image.cols >= kMinWidth, "an image that is wide enough");
  DYNSLAM_ASSERT(part.x >= kRing && part.y >= kRing && right + kRing <= image.cols &&
                     bottom + kRing <= image.rows && threshold >= 0 && threshold <= 255,
                 "a part with a rim and a threshold");
  out.clear();
  const RingOffsets offsets = ring_offsets(static_cast<std::ptrdiff_t>(image.step1()));
  const bool wide = has_wide_rows();
  // Rows of scores by column, where lanes may begin a column before the part and end behind it.
  const auto stride = static_cast<std::size_t>(image.cols + 2 * kWidest);
  scores_.assign(4 * stride, 0);
  const auto scores = [&](int v) {
    return scores_.data() + kWidest + static_cast<std::size_t>(v % 3) * stride;
  };
  std::uint8_t* kept = scores_.data() + kWidest + 3 * stride;
  const auto row = [&](int v) {
    return FastRow{image.ptr<std::uint8_t>(v),
                   scores(v),
                   part.x,
                   right,
                   image.cols - kRing - (wide ? kWidest : 16),
                   threshold};
  };
  for (int v = part.y; v <= bottom; ++v) {
    if (v < bottom) {
      (wide ? score_row_wide : score_row)(row(v), offsets);
      scores(v)[part.x - 1] = scores(v)[right] = 0;  // nothing outside counts
    } else {
      std::fill_n(scores(v) + part.x - 1, part.width + 2, std::uint8_t{0});
    }
    if (v == part.y) continue;
    (wide ? keep_row_wide : keep_row)(row(v - 1), scores(v + 1), scores(v), kept);  // v + 1: v - 2, modulo 3
    list_corners(kept, part.x, right, v - 1, out);
  }
}

}  // namespace dynslam::runtime
