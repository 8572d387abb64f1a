// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/depth_lanes.hpp"
#include "dynslam/segment/growing_criteria.hpp"
#include "dynslam/segment/pixel_runs.hpp"

namespace dynslam::detail {

/// Stands for a barrier that is not there.
struct NoBarrier {
  using Pixel = std::uint8_t;
  [[nodiscard]] static int width() { return 0; }
  [[nodiscard]] static int height() { return 0; }
  [[nodiscard]] std::uint8_t operator()(int, int) const { return 0; }
};

/// 64 pixels, a bit each.
struct GrowingWord {
  std::uint64_t open;    ///< may be entered: valid, in front of the barrier, not taken
  std::uint64_t joined;  ///< open, and so is the pixel to the right, which one may step to
};
/// Those of an image, row by row. What nobody has looked at yet has joined pixels that are not open. Apart:
/// pairs would be written as numbers and read as vectors, for which a processor waits.
struct GrowingWords {
  std::vector<std::uint64_t> open, joined;
};

/// The depth image as growing sees it: runs of pixels between which it may step, found when they are asked
/// for and given out once.
template <class D, class Barrier, class Criterion>
class GrowingField {
 public:
  /// Refers to all of them.
  /// @param words  memory
  GrowingField(const D& depth, const Barrier& barrier, const Criterion& criterion, GrowingWords& words)
      : depth_(depth),
        barrier_(barrier),
        criterion_(criterion),
        words_(words),
        width_(depth.width()),
        height_(depth.height()),
        stride_(words_of_row(width_)) {
    const std::size_t n = stride_ * static_cast<std::size_t>(height_);
    words_.open.assign(n, 0);
    words_.joined.assign(n, ~std::uint64_t{0});
  }

  /// Whether a pixel may be entered and was not yet.
  [[nodiscard]] bool open(int u, int v) {
    return (words_.open[seen(row_of(v), word_of(u), v)] >> bit_of(u) & 1) != 0;
  }

  /// Takes everything that an open pixel reaches, and appends it. @return pixels
  template <Connectivity connectivity>
  std::size_t take_region(int u, int v, std::vector<PixelRun>& runs) {
    constexpr int kReach = connectivity == Connectivity::eight ? 1 : 0;
    std::size_t pixels = 0, head = runs.size();
    const auto add = [&](const PixelRun& run) {
      runs.push_back(run);
      pixels += run.size();
    };
    add(run_around<true>(u, v));
    for (; head < runs.size(); ++head) {
      const PixelRun from = runs[head];
      const int end = std::min(width_, from.end + kReach);
      for (const int row : {from.v - 1, from.v + 1}) {
        if (row < 0 || row >= height_) continue;
        int at = next_open(std::max(0, from.begin - kReach), row, end);
        while (at < end) {
          PixelRun to;
          if (at >= from.begin && at < from.end && step_across(at, from.v, row)) {  // mostly
            to = run_around<true>(at, row);
            add(to);
          } else {
            to = run_around<false>(at, row);
            if (meet<kReach>(from, to)) add(run_around<true>(at, row));
          }
          at = next_open(to.end, row, end);
        }
      }
    }
    return pixels;
  }

 private:
  using S = typename D::Pixel;
  using Depths = const S*;  // of 64 pixels and the one after them

  [[nodiscard]] static int bit_of(int u) { return u & (kWordPixels - 1); }
  [[nodiscard]] static int word_of(int u) { return u / kWordPixels; }
  /// Index of a row's first word.
  [[nodiscard]] std::size_t row_of(int v) const { return static_cast<std::size_t>(v) * stride_; }

  /// Index of word k of row v, which is looked at if it was not yet.
  /// @param row  row_of(v)
  std::size_t seen(std::size_t row, int k, int v) {
    const std::size_t i = row + static_cast<std::size_t>(k);
    if ((words_.joined[i] & ~words_.open[i]) != 0) {
      const GrowingWord word = look(k * kWordPixels, v);
      words_.open[i] = word.open;
      words_.joined[i] = word.joined;
    }
    return i;
  }
  void take(std::size_t word, std::uint64_t bits) {
    words_.open[word] &= ~bits;
    words_.joined[word] &= ~bits;
  }

  /// The first open pixel of [u, end), or end.
  int next_open(int u, int v, int end) {
    for (const std::size_t row = row_of(v); u < end; u += kWordPixels - bit_of(u)) {
      const std::uint64_t bits = words_.open[seen(row, word_of(u), v)] >> bit_of(u);
      if (bits != 0) return std::min(end, u + std::countr_zero(bits));
    }
    return end;
  }

  /// The run of an open pixel.
  /// @tparam takes  whether its pixels are closed
  template <bool takes>
  PixelRun run_around(int u, int v) {
    constexpr std::uint64_t kAll = ~std::uint64_t{0};
    constexpr int kLast = kWordPixels - 1;
    const std::size_t row = row_of(v);
    int k = word_of(u);
    const int bit = bit_of(u);
    const std::size_t middle = row + static_cast<std::size_t>(k);
    const std::uint64_t joined = words_.joined[middle];
    int left = std::countl_one(joined << (kLast - bit) << 1), right = std::countr_one(joined >> bit);
    const bool begins_before = left == bit, ends_after = bit + right == kWordPixels;
    PixelRun run{v, u - left, u + 1 + std::min(right, kLast - bit)};
    if constexpr (takes)
      take(middle, (kAll << (bit - left)) & (kAll >> (kLast - std::min(kLast, bit + right))));
    for (int i = k; begins_before && i > 0;) {
      const std::size_t word = seen(row, --i, v);
      left = std::countl_one(words_.joined[word]);
      if (left == 0) break;
      if constexpr (takes) take(word, kAll << (kWordPixels - left));
      run.begin -= left;
      if (left < kWordPixels) break;
    }
    while (ends_after) {
      const std::size_t word = seen(row, ++k, v);
      right = std::countr_one(words_.joined[word]);
      const int more = std::min(right + 1, kWordPixels);
      if constexpr (takes) take(word, kAll >> (kWordPixels - more));
      run.end += more;
      if (right < kWordPixels) break;
    }
    return run;
  }

  /// To the same column of another row.
  [[nodiscard]] bool step_across(int u, int v, int v_to) const {
    return step(u, v, image_row(depth_, v)[u], u, v_to, image_row(depth_, v_to)[u]);
  }
  [[nodiscard]] bool step(int u, int v, S z, int u_to, int v_to, S z_to) const {
    return may_step(criterion_, GrowingSite<S>{u, v, z}, GrowingSite<S>{u_to, v_to, z_to});
  }
  /// Whether one may step from a run to one of a neighbouring row.
  template <int reach>
  [[nodiscard]] bool meet(const PixelRun& from, const PixelRun& to) const {
    const auto z = image_row(depth_, from.v);
    const auto z_to = image_row(depth_, to.v);
    const int end = std::min(from.end, to.end + reach);
    for (int u = std::max(from.begin, to.begin - reach); u < end; ++u) {
      for (int x = std::max(to.begin, u - reach); x <= std::min(to.end - 1, u + reach); ++x) {
        if (step(u, from.v, z[u], x, to.v, z_to[x])) return true;
      }
    }
    return false;
  }

  /// Word of the 64 pixels from u on, fewer at the end of the row.
  [[nodiscard]] GrowingWord look(int u, int v) const {
    if constexpr (RowImage<D>) {
      if (width_ - u > kWordPixels) return look(static_cast<Depths>(depth_.row(v)) + u, u, v);
    }
    return look_at_copy(u, v);
  }
  [[nodiscard, gnu::noinline]] GrowingWord look_at_copy(int u, int v) const {
    const int n = std::min(kWordPixels + 1, width_ - u);
    std::array<S, kWordPixels + 1> copy;
    copy.fill(S(0));  // beyond the image
    const auto row = image_row(depth_, v);
    for (int i = 0; i < n; ++i) copy[static_cast<std::size_t>(i)] = row[u + i];
    return look(copy.data(), u, v);
  }
  [[nodiscard, gnu::noinline]] GrowingWord look(Depths z, int u, int v) const {
    GrowingWord w = look_at_depths(z);
    bool after = is_valid_depth(z[kWordPixels]);  // whether the pixel after the word is open
    if constexpr (!std::is_same_v<Barrier, NoBarrier>) {
      const auto row = image_row(barrier_, v);
      w.open &= ~nonzero_bits(row, u, std::min(kWordPixels, width_ - u));
      if (u + kWordPixels < width_) after = after && row[u + kWordPixels] == 0;
    }
    w.joined &= w.open & (w.open >> 1 | static_cast<std::uint64_t>(after) << (kWordPixels - 1));
    if constexpr (!kLanes) {
      for (std::uint64_t rest = w.joined; rest != 0; rest &= rest - 1) {
        const int i = std::countr_zero(rest);
        if (!step(u + i, v, z[i], u + i + 1, v, z[i + 1])) w.joined &= ~(std::uint64_t{1} << i);
      }
    }
    return w;
  }

  static constexpr bool kLanes = LaneCriterion<Criterion, S>;

  /// What is valid of 64 pixels, and where the criterion steps to the right if it may be asked here; said of
  /// pairs of open pixels.
  [[nodiscard]] GrowingWord look_at_depths(Depths z) const {
    constexpr std::uint64_t kAll = ~std::uint64_t{0};
    GrowingWord w{0, kAll};
    if constexpr (kLanes) {
      w.joined = 0;
      auto nearest = load_lanes(z);
      for (int at = 0; at < kWordPixels; at += kPartPixels) {
        w.joined |= bits_of_part<S>([&](int i) {
                      const auto here = load_lanes(z + at + i);
                      nearest = smaller(here, nearest);
                      return criterion_.lanes(here, load_lanes(z + at + i + 1));
                    })
                    << at;
      }
      const bool positive = bits_of_lanes<S>(nearest > S(0)) == (1U << DepthLanes<S>::kCount) - 1;
      const bool finite = (w.joined | w.joined << 1) == kAll;  // one may step to them or from them
      if (positive & finite) return {kAll, w.joined};
    }
    return {valid_bits(z), w.joined};
  }
  /// Apart, so that what is mostly enough needs few registers.
  [[nodiscard, gnu::noinline]] static std::uint64_t valid_bits(Depths z) {
    std::uint64_t bits = 0;
    for (int at = 0; at < kWordPixels; at += kPartPixels)
      bits |= bits_of_part<S>([&](int i) { return valid_lanes<S>(load_lanes(z + at + i)); }) << at;
    return bits;
  }

  const D& depth_;
  const Barrier& barrier_;
  const Criterion& criterion_;
  GrowingWords& words_;
  int width_, height_;
  std::size_t stride_;
};

/// Pixels of valid depth.
template <class D>
[[nodiscard]] std::size_t count_valid(const D& depth) {
  using S = typename D::Pixel;
  constexpr int kCount = DepthLanes<S>::kCount;
  std::size_t valid = 0;
  for (int v = 0; v < depth.height(); ++v) {
    const auto z = image_row(depth, v);
    int u = 0;
    if constexpr (RowImage<D> && kCount > 1) {
      const S* row = depth.row(v);
      typename DepthLanes<S>::Mask sum{};
      for (; u + kCount <= depth.width(); u += kCount) sum -= valid_lanes<S>(load_lanes(row + u));
      for (int i = 0; i < kCount; ++i) valid += static_cast<std::size_t>(sum[i]);
    }
    for (; u < depth.width(); ++u) valid += is_valid_depth(z[u]) ? 1 : 0;
  }
  return valid;
}

}  // namespace dynslam::detail
