// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/robust/split_mix64.hpp"

namespace dynslam {

/// How many minimal samples sample_consensus() draws.
template <std::floating_point S>
struct SamplingOptions {
  int max_iterations = 300;
  S confidence = S(0.99);  ///< of having drawn one clean sample, when to stop; 0: never before max_iterations
  std::uint64_t seed = 1;  ///< same seed, same result
};

/// Samples of K that must be drawn for one without outliers, with the confidence asked for, where `share` of
/// the data are inliers: log(1 - confidence) / log(1 - share^K) (Fischler and Bolles 1981), at most `most`.
template <std::size_t K, std::floating_point S>
[[nodiscard]] int samples_needed(S share, S confidence, int most) {
  S clean = S(1);
  for (std::size_t k = 0; k < K; ++k) clean *= share;
  if (clean >= S(1)) return 0;
  const S miss = std::log(S(1) - clean);
  if (!(miss < S(0)) || !(confidence > S(0))) return most;
  const S wanted = std::ceil(std::log(S(1) - confidence) / miss);
  return wanted < static_cast<S>(most) ? static_cast<int>(wanted) : most;
}

/// K different indices; `one()` draws an index, of which there must be K or more.
template <std::size_t K, std::invocable One>
void draw_distinct(One&& one, std::array<std::size_t, K>& sample) {
  for (std::size_t k = 0; k < K; ++k) {
    const auto end = sample.begin() + static_cast<std::ptrdiff_t>(k);
    do {
      sample[k] = one();
    } while (std::find(sample.begin(), end, sample[k]) != end);
  }
}
/// K different indices below n, all equally likely. Requires n >= K.
template <std::size_t K>
void draw_distinct(SplitMix64& random, std::size_t n, std::array<std::size_t, K>& sample) {
  draw_distinct([&] { return static_cast<std::size_t>(random.below(static_cast<int>(n))); }, sample);
}

/// The one loop of sampling consensus (RANSAC, MSAC, LO-RANSAC): draws minimal samples from a seeded
/// generator, has each solved and judged, and stops once the best one's inliers make a better unlikely. F and
/// H (inlier_consensus), absolute_pose and pose_consensus run in it.
///
/// @param draw   draw(random, sample) -> bool: fills std::array<std::size_t, K>; false spends the iteration
///               (a repeated index, say). draw_distinct() is the usual one; weights or a subset of the
///               data are the caller's.
/// @param solve  solve(sample, consider): calls consider(model) once per hypothesis of the sample, or not at
///               all where the sample is refused
/// @param judge  judge(model) -> std::optional<S>: empty unless the model is better than all before; else the
///               judge keeps it, may refine it on its inliers, and answers with its share of inliers. A cost
///               that is summed may end early as soon as it exceeds the best (early exit).
/// @return iterations done
template <std::size_t K, std::floating_point S, class Draw, class Solve, class Judge>
int sample_consensus(const SamplingOptions<S>& options, Draw&& draw, Solve&& solve, Judge&& judge) {
  SplitMix64 random(options.seed);
  std::array<std::size_t, K> sample{};
  int needed = options.max_iterations, done = 0;
  const auto consider = [&](const auto& model) {
    const std::optional<S> share = judge(model);
    if (share) needed = std::min(needed, samples_needed<K>(*share, options.confidence, needed));
  };
  for (; done < needed; ++done) {
    if (draw(random, sample)) solve(sample, consider);
  }
  return done;
}

/// Options of a RANSAC over matches that are judged by a distance in pixels.
template <std::floating_point S>
struct RansacOptions {
  S threshold_px = S(1);   ///< distance of an inlier [px]
  S confidence = S(0.99);  ///< of having drawn one clean sample
  int max_iterations = 300;
  int min_inliers = 16;
  int refinements = 5;  ///< least squares on the inliers of each new best model, while that gains some
  std::uint64_t seed = 1;
};

/// Memory of the RANSACs over matches.
struct RansacWorkspace {
  std::vector<std::uint8_t> flags;
  std::vector<int> index;
  std::vector<float> coarse;  // of normalised matches
  std::vector<double> fine, sorted;
};

/// What a RANSAC over matches found.
template <class Model>
struct RansacOutcome {
  std::optional<Model> model;        ///< empty: too few matches or inliers
  std::vector<std::uint8_t> inlier;  ///< one flag per match
  int inliers = 0;
  int iterations = 0;
};

/// The model with most inliers among n data, each best so far refined by least squares on its inliers.
/// @param solve     solve(std::span<const int> index) -> std::optional<Model>, for K data and for more
/// @param distance2 distance2(model, i) -> squared distance of datum i [px^2]
template <std::size_t K, class Model, std::floating_point S, class Solve, class Distance>
[[nodiscard]] RansacOutcome<Model> inlier_consensus(std::size_t n, const RansacOptions<S>& options,
                                                    Solve&& solve, Distance&& distance2,
                                                    RansacWorkspace& workspace) {
  RansacOutcome<Model> result;
  result.inlier.assign(n, 0);
  if (n < std::max(K, static_cast<std::size_t>(std::max(0, options.min_inliers)))) return result;
  auto& flags = workspace.flags;
  flags.resize(n);
  const S limit = options.threshold_px * options.threshold_px;
  const auto count = [&](const Model& model) {
    int inliers = 0;
    for (std::size_t i = 0; i < n; ++i) {
      flags[i] = distance2(model, i) <= limit ? 1 : 0;
      inliers += flags[i];
    }
    return inliers;
  };
  const auto keep = [&](const Model& model, int inliers) {
    result.model = model;
    result.inliers = inliers;
    result.inlier.swap(flags);
  };
  // A sample is as few data as will do, so its noise is the model's: least squares on what agrees with it
  // finds more that does (LO-RANSAC, Chum et al. 2003).
  const auto refine = [&] {
    for (int round = 0; round < options.refinements; ++round) {
      workspace.index.clear();
      for (std::size_t i = 0; i < n; ++i) {
        if (result.inlier[i] != 0) workspace.index.push_back(static_cast<int>(i));
      }
      const std::optional<Model> model = solve(std::span<const int>(workspace.index));
      if (!model) return;
      const int inliers = count(*model), gained = inliers - result.inliers;
      if (gained < 0) return;
      keep(*model, inliers);
      if (gained == 0) return;
    }
  };
  const SamplingOptions<S> sampling{options.max_iterations, options.confidence, options.seed};
  result.iterations = sample_consensus<K, S>(
      sampling,
      [n](SplitMix64& random, std::array<std::size_t, K>& sample) {
        draw_distinct(random, n, sample);
        return true;
      },
      [&](const std::array<std::size_t, K>& sample, const auto& consider) {
        std::array<int, K> index;
        for (std::size_t k = 0; k < K; ++k) index[k] = static_cast<int>(sample[k]);
        if (const std::optional<Model> model = solve(std::span<const int>(index))) consider(*model);
      },
      [&](const Model& model) -> std::optional<S> {
        const int inliers = count(model);
        if (inliers <= result.inliers) return std::nullopt;
        keep(model, inliers);
        if (static_cast<std::size_t>(inliers) > K) refine();
        return static_cast<S>(result.inliers) / static_cast<S>(n);
      });
  if (result.inliers < options.min_inliers) result.model.reset();
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
