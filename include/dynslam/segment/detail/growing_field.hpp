// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/segment/connectivity.hpp"
#include "dynslam/segment/detail/depth_lanes.hpp"
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
/// What is known of a word of an image.
enum class WordState : std::uint8_t { unknown, counted, seen };

/// Memory of a GrowingField. The words of an image, row by row, in arrays of their own: pairs would be
/// written as numbers and read as vectors, for which a processor waits.
struct GrowingWords {
  std::vector<std::uint64_t> open, joined;
  std::vector<WordState> state;  ///< by word; without a look it means nothing
  /// By run of a region: -1 or 1 where the row above or below has nothing more for it, or 0.
  std::vector<std::int8_t> settled;
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
    words_.open.resize(n);
    words_.joined.resize(n);
    words_.state.assign(n, WordState::unknown);
  }

  /// Whether a pixel may be entered and was not yet.
  [[nodiscard]] bool open(int u, int v) { return (words_.open[seen(word_of(u), v)] >> bit_of(u) & 1) != 0; }

  /// Whether `pixels` are more than this share of the valid ones; of 1 or more never. No more of the image is
  /// counted than that takes: of what was looked at it is known, and small regions, which most are, need few.
  [[nodiscard]] bool more_than_share(std::size_t pixels, double share) {
    if (share >= 1) return false;
    const auto limit = [&] {
      return static_cast<std::size_t>(std::max(0.0, share) * static_cast<double>(valid_));
    };
    while (pixels > limit()) {
      if (counted_rows_ == height_) return true;
      count_row(counted_rows_++);
    }
    return false;
  }

  /// Takes everything that an open pixel reaches, and appends it. @return pixels
  template <Connectivity connectivity>
  std::size_t take_region(int u, int v, std::vector<PixelRun>& runs) {
    constexpr int kReach = connectivity == Connectivity::eight ? 1 : 0;
    const std::size_t first = runs.size();
    words_.settled.clear();
    std::size_t pixels = take_run(u, v, runs).size();
    words_.settled.push_back(0);
    for (std::size_t i = first; i < runs.size(); ++i) {
      const PixelRun from = runs[i];
      const int settled = words_.settled[i - first];
      if (settled >= 0 && from.v > 0) pixels += take_neighbours<kReach>(from, -1, runs);
      if (settled <= 0 && from.v + 1 < height_) pixels += take_neighbours<kReach>(from, 1, runs);
    }
    return pixels;
  }

 private:
  using S = typename D::Pixel;
  static constexpr std::uint64_t kAll = ~std::uint64_t{0};
  using Depths = const S*;  // of 64 pixels and the one after them

  [[nodiscard]] static int bit_of(int u) { return u & (kWordPixels - 1); }
  [[nodiscard]] static int word_of(int u) { return u / kWordPixels; }
  /// Index of a row's first word.
  [[nodiscard]] std::size_t row_of(int v) const { return static_cast<std::size_t>(v) * stride_; }

  /// Index of word k of row v, which is looked at if it was not yet, and so are those after it up to `last`:
  /// together that is faster than one by one.
  std::size_t seen(int k, int last, int v) {
    const std::size_t i = row_of(v) + static_cast<std::size_t>(k);
    if (!is_seen(i)) look_along(k, last, v);
    return i;
  }
  std::size_t seen(int k, int v) { return seen(k, k, v); }
  [[nodiscard]] bool is_seen(std::size_t word) const { return words_.state[word] == WordState::seen; }
  /// Looks at those of the words [k, last] of a row that nobody has looked at.
  [[gnu::noinline]] void look_along(int k, int last, int v) {
    each_word(k, last, v, [&](std::size_t i, Depths z, int u) {
      if (is_seen(i)) return;
      const std::size_t before = valid_;
      const GrowingWord word = look(z, u, v);
      if (words_.state[i] == WordState::counted) valid_ = before;
      words_.open[i] = word.open;
      words_.joined[i] = word.joined;
      words_.state[i] = WordState::seen;
    });
  }
  [[gnu::noinline]] void count_row(int v) {
    each_word(0, static_cast<int>(stride_) - 1, v, [&](std::size_t i, Depths z, int) {
      if (words_.state[i] != WordState::unknown) return;
      valid_ += static_cast<std::size_t>(std::popcount(valid_bits(z)));
      words_.state[i] = WordState::counted;
    });
  }
  /// Calls f(index, depths, u) for the words [k, last] of a row. Beyond the image depths are 0.
  template <class F>
  void each_word(int k, int last, int v, const F& f) {
    const std::size_t row = row_of(v);
    if constexpr (RowImage<D>) {
      const Depths z = depth_.row(v);
      for (const int whole = (width_ - 1) / kWordPixels; k <= last && k < whole; ++k)
        f(row + static_cast<std::size_t>(k), z + k * kWordPixels, k * kWordPixels);
    }
    for (; k <= last; ++k) {
      const int u = k * kWordPixels, n = std::min(kWordPixels + 1, width_ - u);
      std::array<S, kWordPixels + 1> copy;
      copy.fill(S(0));
      const auto from = image_row(depth_, v);
      for (int i = 0; i < n; ++i) copy[static_cast<std::size_t>(i)] = from[u + i];
      f(row + static_cast<std::size_t>(k), copy.data(), u);
    }
  }
  void take(std::size_t word, std::uint64_t bits) {
    words_.open[word] &= ~bits;
    words_.joined[word] &= ~bits;
  }

  /// Takes the run of an open pixel, and appends it.
  const PixelRun& take_run(int u, int v, std::vector<PixelRun>& runs) {
    PixelRun& run = runs.emplace_back();
    find_run<true>(u, v, run);
    return run;
  }
  /// Takes what one may step to from a run to the row above or below (side -1 or 1). @return pixels
  template <int reach>
  std::size_t take_neighbours(const PixelRun& from, int side, std::vector<PixelRun>& runs) {
    const int v = from.v + side;
    int begin = std::max(0, from.begin - reach);
    const int end = std::min(width_, from.end + reach), last = word_of(end - 1);
    std::size_t pixels = 0;
    for (int k = word_of(begin); k <= last; ++k) {
      std::uint64_t open = words_.open[seen(k, last, v)] & kAll << bit_of(std::max(begin, k * kWordPixels));
      while (open != 0) {
        const int at = k * kWordPixels + std::countr_zero(open);
        if (at >= end) return pixels;
        PixelRun to{v, at, at + 1};
        bool reached = at >= from.begin && at < from.end && step_across(at, from.v, v);  // mostly
        if (!reached && !(reach == 0 && stands_alone(at, v))) {
          find_run<false>(at, v, to);
          reached = meet<reach>(from, to);
        }
        if (reached) {
          const PixelRun& taken = take_run(at, v, runs);
          const bool beside_from = taken.begin - reach >= from.begin && taken.end + reach <= from.end;
          words_.settled.push_back(static_cast<std::int8_t>(beside_from ? -side : 0));
          pixels += taken.size();
          to.end = taken.end;
        }
        begin = to.end;
        if (word_of(begin) != k) break;
        open &= kAll << bit_of(begin);
      }
      k = std::max(k, word_of(begin) - 1);
    }
    return pixels;
  }
  /// Whether an open pixel of a seen word is known to be a run of its own, to which then nothing leads but a
  /// step from above or below.
  [[nodiscard]] bool stands_alone(int u, int v) const {
    const std::uint64_t joined = words_.joined[row_of(v) + static_cast<std::size_t>(word_of(u))];
    return bit_of(u) > 0 && (joined >> (bit_of(u) - 1) & 3) == 0;
  }

  /// The run of an open pixel.
  /// @tparam takes  whether its pixels are closed
  /// @param run  out; its parts are written one by one, and a processor would wait for who reads all at once
  template <bool takes>
  void find_run(int u, int v, PixelRun& run) {
    constexpr int kLast = kWordPixels - 1;
    int k = word_of(u);
    const int bit = bit_of(u);
    const std::size_t middle = row_of(v) + static_cast<std::size_t>(k);
    const std::uint64_t joined = words_.joined[middle];
    int left = std::countl_one(joined << (kLast - bit) << 1), right = std::countr_one(joined >> bit);
    const bool begins_before = left == bit, ends_after = bit + right == kWordPixels;
    int begin = u - left, end = u + 1 + std::min(right, kLast - bit);
    if constexpr (takes)
      take(middle, (kAll << (bit - left)) & (kAll >> (kLast - std::min(kLast, bit + right))));
    for (int i = k; begins_before && i > 0;) {
      const std::size_t word = seen(--i, v);
      left = std::countl_one(words_.joined[word]);
      if (left == 0) break;
      if constexpr (takes) take(word, kAll << (kWordPixels - left));
      begin -= left;
      if (left < kWordPixels) break;
    }
    while (ends_after) {
      const std::size_t word = seen(++k, v);
      right = std::countr_one(words_.joined[word]);
      const int more = std::min(right + 1, kWordPixels);
      if constexpr (takes) take(word, kAll >> (kWordPixels - more));
      end += more;
      if (right < kWordPixels) break;
    }
    run.v = v;
    run.begin = begin;
    run.end = end;
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

  /// Word of the 64 pixels from u on, and counts those that are valid.
  [[nodiscard]] GrowingWord look(Depths z, int u, int v) {
    constexpr bool kBarrier = !std::is_same_v<Barrier, NoBarrier>;
    std::uint64_t open = kAll, joined = kAll;
    bool after = true;  // whether the pixel after the word is open
    bool valid = false;
    if constexpr (kLanes) {
      const LaneSteps steps = steps_of_lanes(z);
      joined = steps.joined;
      valid = steps.valid;
      if (valid) valid_ += kWordPixels;
      if (valid && !kBarrier) return {open, joined};  // mostly
    }
    if (!valid) {
      open = valid_bits(z);
      after = is_valid_depth(z[kWordPixels]);
      valid_ += static_cast<std::size_t>(std::popcount(open));
    }
    if constexpr (kBarrier) {
      const auto row = image_row(barrier_, v);
      open &= ~nonzero_bits(row, u, std::min(kWordPixels, width_ - u));
      if (u + kWordPixels < width_) after = after && row[u + kWordPixels] == 0;
    }
    joined &= open & (open >> 1 | static_cast<std::uint64_t>(after) << (kWordPixels - 1));
    if constexpr (!kLanes) {
      for (std::uint64_t rest = joined; rest != 0; rest &= rest - 1) {
        const int i = std::countr_zero(rest);
        if (!step(u + i, v, z[i], u + i + 1, v, z[i + 1])) joined &= ~(std::uint64_t{1} << i);
      }
    }
    return {open, joined};
  }

  static constexpr bool kLanes = LaneCriterion<Criterion, S>;
  static constexpr bool kBounded = BoundedLaneCriterion<Criterion, S>;

  /// What a criterion by lanes tells of 64 pixels.
  struct LaneSteps {
    std::uint64_t joined;  ///< where it steps to the right; said of pairs of valid pixels
    bool valid;            ///< whether all are known to be, and the pixel after them where it steps there
  };
  [[nodiscard]] LaneSteps steps_of_lanes(Depths z) const {
    constexpr int kCount = DepthLanes<S>::kCount;
    // Of a bounded criterion one vector of four tells of the rest, which a few steps lead to.
    constexpr int kSample = 4;
    auto nearest = load_lanes(z + (kBounded ? kSample : kWordPixels + 1 - kCount));
    std::uint64_t joined = 0;
    for (int at = 0; at < kWordPixels; at += kPartPixels) {
      joined |= bits_of_part<S>([&](int i) {
                  const auto here = load_lanes(z + at + i);
                  if (!kBounded || i == kSample) nearest = smaller(here, nearest);
                  return criterion_.lanes(here, load_lanes(z + at + i + 1));
                })
                << at;
    }
    S beyond = 0;
    bool known;
    if constexpr (kBounded) {
      // With one break at most, and none before the first sample or behind the last, steps lead from a
      // sample to every pixel, fewer than a part has.
      constexpr int kLast = kWordPixels - kPartPixels + kSample + kCount - 1;
      constexpr std::uint64_t kInside = kAll >> 1;
      constexpr std::uint64_t kEnds = ((std::uint64_t{1} << kSample) - 1) | (kInside >> kLast << kLast);
      const std::uint64_t breaks = ~joined & kInside;
      known = ((breaks & (breaks - 1)) | (breaks & kEnds)) == 0;
      beyond = static_cast<S>(kPartPixels) * criterion_.largest_step();
    } else {
      known = (joined | joined << 1) == kAll;  // finite: one may step to them or from them
    }
    const bool positive = bits_of_lanes<S>(nearest > beyond) == (1U << kCount) - 1;
    return {joined, known && positive};
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
  std::size_t valid_ = 0;  // pixels of the words that are not unknown
  int counted_rows_ = 0;
};

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
