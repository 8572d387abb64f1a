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
/// Those of an image, row by row. What nobody has looked at yet has joined pixels that are not open.
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
  [[nodiscard]] bool open(int u, int v) { return (words_.open[seen(u, v)] >> bit_of(u) & 1) != 0; }

  /// Takes everything that an open pixel reaches, and appends it. @return pixels
  template <Connectivity connectivity>
  std::size_t take_region(int u, int v, std::vector<PixelRun>& runs) {
    constexpr int kReach = connectivity == Connectivity::eight ? 1 : 0;
    std::size_t pixels = 0, head = runs.size();
    const auto add = [&](const PixelRun& run) {
      take(run);
      runs.push_back(run);
      pixels += run.size();
    };
    add(run_around(u, v));
    for (; head < runs.size(); ++head) {
      const PixelRun from = runs[head];
      const int end = std::min(width_, from.end + kReach);
      for (const int row : {from.v - 1, from.v + 1}) {
        if (row < 0 || row >= height_) continue;
        int at = next_open(std::max(0, from.begin - kReach), row, end);
        while (at < end) {
          const PixelRun to = run_around(at, row);
          if (meet<kReach>(from, to)) add(to);
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

  [[nodiscard]] std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v) * stride_ + static_cast<std::size_t>(u) / kWordPixels;
  }
  /// Index of a pixel's word, which is looked at if it was not yet.
  std::size_t seen(int u, int v) {
    const std::size_t k = index(u, v);
    if ((words_.joined[k] & ~words_.open[k]) != 0) {
      const GrowingWord word = look(u - bit_of(u), v);
      words_.open[k] = word.open;
      words_.joined[k] = word.joined;
    }
    return k;
  }

  /// The first open pixel of [u, end), or end.
  int next_open(int u, int v, int end) {
    for (; u < end; u += kWordPixels - bit_of(u)) {
      const std::uint64_t bits = words_.open[seen(u, v)] >> bit_of(u);
      if (bits != 0) return std::min(end, u + std::countr_zero(bits));
    }
    return end;
  }

  /// The run of an open pixel.
  PixelRun run_around(int u, int v) {
    PixelRun run{v, u, u + 1};
    while (run.begin > 0) {
      const int at = run.begin - 1, before = bit_of(at);  // of the pixels before it in its word
      const int n = std::countl_one(words_.joined[seen(at, v)] << (kWordPixels - 1 - before));
      run.begin -= n;
      if (n <= before) break;
    }
    for (;;) {
      const int at = run.end - 1, before = bit_of(at);
      const int n = std::countr_one(words_.joined[seen(at, v)] >> before);
      run.end += n;
      if (n < kWordPixels - before) break;
    }
    return run;
  }

  void take(const PixelRun& run) {
    for (int u = run.begin; u < run.end; u += kWordPixels - bit_of(u)) {
      const int from = bit_of(u), n = std::min(run.end - u, kWordPixels - from);
      const std::uint64_t rest = ~(~std::uint64_t{0} >> (kWordPixels - n) << from);
      const std::size_t k = index(u, run.v);
      words_.open[k] &= rest;
      words_.joined[k] &= rest;
    }
  }

  [[nodiscard]] bool step(int u, int v, S z, int u_to, int v_to, S z_to) const {
    return may_step(criterion_, GrowingSite<S>{u, v, z}, GrowingSite<S>{u_to, v_to, z_to});
  }
  /// Whether one may step from a run to one of a neighbouring row. Mostly the first pair decides.
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
  [[nodiscard, gnu::noinline]] GrowingWord look(int u, int v) const {
    const int n = std::min(kWordPixels + 1, width_ - u);
    if constexpr (RowImage<D>) {
      if (n > kWordPixels) return look(static_cast<Depths>(depth_.row(v)) + u, u, v);
    }
    std::array<S, kWordPixels + 1> copy;
    copy.fill(S(0));  // beyond the image
    const auto row = image_row(depth_, v);
    for (int i = 0; i < n; ++i) copy[static_cast<std::size_t>(i)] = row[u + i];
    return look(copy.data(), u, v);
  }
  [[nodiscard]] GrowingWord look(Depths z, int u, int v) const {
    GrowingWord w{0, 0};
    for (int at = 0; at < kWordPixels; at += kPartPixels) {
      const GrowingWord part = look_at_part(z + at);
      w.open |= part.open << at;
      w.joined |= part.joined << at;
    }
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
  static constexpr int kPartPixels = 16;

  /// What is valid of 16 pixels, and where the criterion steps to the right if it may be asked here; said of
  /// pairs of open pixels.
  [[nodiscard]] GrowingWord look_at_part(Depths z) const {
    constexpr std::uint64_t kAll = 0xffff;
    constexpr int kCount = DepthLanes<S>::kCount;
    if constexpr (kLanes) {
      if (all_joined(z)) return {kAll, kAll};
    }
    GrowingWord part{0, kLanes ? 0 : kAll};
    for (int i = 0; i < kPartPixels; i += kCount) {
      const auto here = load_lanes(z + i);
      part.open |= static_cast<std::uint64_t>(bits_of_lanes<S>(valid_lanes<S>(here))) << i;
      if constexpr (kLanes)
        part.joined |=
            static_cast<std::uint64_t>(bits_of_lanes<S>(criterion_.lanes(here, load_lanes(z + i + 1)))) << i;
    }
    return part;
  }
  /// Whether 16 pixels are valid and joined, and with the next one if it is valid: from a valid depth the
  /// criterion steps to finite ones alone.
  [[nodiscard]] bool all_joined(Depths z) const {
    auto nearest = load_lanes(z);
    typename DepthLanes<S>::Mask all = valid_lanes<S>(nearest);
    for (int i = 0; i < kPartPixels; i += DepthLanes<S>::kCount) {
      const auto here = load_lanes(z + i);
      nearest = smaller(nearest, here);
      all &= criterion_.lanes(here, load_lanes(z + i + 1));
    }
    return bits_of_lanes<S>(all & (nearest > S(0))) == (1U << DepthLanes<S>::kCount) - 1;
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
