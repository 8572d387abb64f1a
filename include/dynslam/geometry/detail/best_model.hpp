// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/robust/consensus.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam::detail {

/// The first matches, of which a step is made.
struct FirstMatches {
  std::size_t count;
  [[nodiscard]] std::size_t size() const { return count; }
  [[nodiscard]] std::size_t operator()(std::size_t i) const { return i; }
};
/// Those listed. Beyond the last, it is asked for again.
struct ListedMatches {
  std::span<const int> index;
  [[nodiscard]] std::size_t size() const { return index.size(); }
  [[nodiscard]] std::size_t operator()(std::size_t i) const {
    return static_cast<std::size_t>(index[std::min(i, index.size() - 1)]);
  }
};

/// The best model of matches so far, refined on its inliers (LO-RANSAC, Chum et al. 2003; Lebeda et al.
/// 2012).
/// @tparam Search  size() of the matches; score(model, beaten): what they are worth, any number below
/// `beaten`
///                 where it is not more than that; inliers(model); near(model, i): whether i is one;
///                 step<T>(model, matches, wide) -> std::optional<Matrix3d>: a step of robust least squares
///                 on matches nearer than the threshold, its square being `wide` times as large
template <class Search>
class BestModel {
 public:
  BestModel(Search& search, int refinements) : search_(search), refinements_(refinements) {}

  /// Takes a model that is better than the best, and refines it. @return whether it is
  bool consider(const Eigen::Matrix3d& model, int sample) {
    if (!keep(model)) return false;
    inliers_ = search_.inliers(model_);
    if (inliers_ > sample) refine(model_);
    return true;
  }
  /// Refines a model that need not be better than the best yet, to see whether it is then.
  void challenge(const Eigen::Matrix3d& model) {
    keep(model);
    refine(model);
  }

  /// Least squares of a few inliers each, as they are drawn, as long as that finds a better model: where
  /// parallax is small, or most points are on a plane, the best sample is in a minimum of its own.
  /// @param idle   draws without a better one after which it is over
  /// @param index  scratch
  void draw_from_inliers(int idle, std::uint64_t seed, std::vector<int>& index) {
    constexpr std::size_t kDrawn = 24;
    constexpr int kDraws = 300;
    constexpr double kAll = 1e6;  // however far they are off
    if (refinements_ <= 0) return;
    SplitMix64 random(seed);
    for (int draw = 0, vain = 0; draw < kDraws && vain < idle; ++draw) {
      if (vain == 0) {
        index.clear();
        for (std::size_t i = 0; i < search_.size(); ++i) {
          if (search_.near(model_, i)) index.push_back(static_cast<int>(i));
        }
        if (index.size() < 2 * kDrawn) return;
      }
      for (std::size_t k = 0; k < kDrawn; ++k) std::swap(index[k], index[k + random.index(index.size() - k)]);
      const ListedMatches drawn{std::span<const int>(index).first(kDrawn)};
      const std::optional<Eigen::Matrix3d> model = search_.template step<float>(model_, drawn, kAll);
      const bool better = model && keep(*model);
      if (better) refine(model_);
      vain = better ? 0 : vain + 1;
    }
  }

  /// Least squares of all inliers, in double.
  void finish() {
    if (inliers_ == 0) return;
    const FirstMatches all{search_.size()};
    constexpr int kSteps = 3;  // from the minimum of some to that of all
    Eigen::Matrix3d current = model_;
    for (int k = 0; k < kSteps && refinements_ > 0; ++k) {
      const auto next = k == 0 ? search_.template step<float>(current, all, 1.0)
                               : search_.template step<double>(current, all, 1.0);
      if (!next) break;
      current = *next;
      keep(current);
    }
    inliers_ = search_.inliers(model_);
  }

  [[nodiscard]] const Eigen::Matrix3d& model() const { return model_; }
  [[nodiscard]] int inliers() const { return inliers_; }  ///< 0: none yet

 private:
  bool keep(const Eigen::Matrix3d& model) {
    const float reached = search_.score(model, score_);
    if (!(reached > score_)) return false;
    score_ = reached;
    model_ = model;
    return true;
  }
  /// On some of the matches, which are in random order, and from what lies within twice the threshold first:
  /// the noise of a minimal sample hides inliers there.
  void refine(Eigen::Matrix3d current) {
    constexpr std::size_t kSome = 128;
    const FirstMatches some{std::min(kSome, search_.size())};
    for (int round = 0; round < refinements_; ++round) {
      const double wide = std::max(1.0, 2.0 - round / 3.0);
      const auto next = search_.template step<float>(current, some, wide * wide);
      if (!next) break;
      current = *next;
      if (!keep(current) && round >= 3) break;
    }
    inliers_ = search_.inliers(model_);
  }

  Search& search_;
  int refinements_, inliers_ = 0;
  float score_ = 0;
  Eigen::Matrix3d model_ = Eigen::Matrix3d::Zero();
};

/// Models of matches by the sampling loop. @param minimal  minimal(sample, consider): calls
/// consider(Matrix3d) once per hypothesis. @return iterations
template <std::size_t K, std::floating_point S, class Search, class Minimal>
int search_models(std::size_t n, const RansacOptions<S>& options, BestModel<Search>& best,
                  const Minimal& minimal) {
  const SamplingOptions<S> sampling{options.max_iterations, options.confidence, options.seed};
  return sample_consensus<K, S>(
      sampling,
      [n](SplitMix64& random, std::array<std::size_t, K>& sample) {
        draw_distinct(random, n, sample);
        return true;
      },
      minimal,
      [&](const Eigen::Matrix3d& model) -> std::optional<S> {
        if (!best.consider(model, static_cast<int>(K))) return std::nullopt;
        return static_cast<S>(best.inliers()) / static_cast<S>(n);
      });
}

/// Draws from the inliers without a better model that are worth it after so many samples: a tenth or so of
/// the time that these took.
[[nodiscard]] inline int idle_draws(int iterations) {
  return std::clamp(iterations / 6, 8, 100);
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
