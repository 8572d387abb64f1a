// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "dynslam/geometry/detail/best_model.hpp"
#include "dynslam/geometry/detail/epipolar_step.hpp"
#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/detail/plane_of_inliers.hpp"
#include "dynslam/geometry/epipolar_distance.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/geometry/so3.hpp"
#include "dynslam/robust/consensus.hpp"

namespace dynslam::detail {

/// Sampson's distance in matches' normalised coordinates as F changes, for fundamental_ransac.
template <std::same_as<double> W>  // of a template nothing is compiled where it is not used
class FundamentalSearch {
  struct Parts {
    float e2, g;
  };
  [[nodiscard]] static auto sampson(const Eigen::Matrix<W, 3, 3>& F) {
    const Eigen::Matrix<float, 3, 3> f = F.template cast<float>();
    const float f00 = f(0, 0), f01 = f(0, 1), f02 = f(0, 2), f10 = f(1, 0), f11 = f(1, 1), f12 = f(1, 2),
                f20 = f(2, 0), f21 = f(2, 1), f22 = f(2, 2);
    return [=](float x, float y, float x_m, float y_m) {
      const float a = f00 * x + f01 * y + f02, b = f10 * x + f11 * y + f12, c = f20 * x + f21 * y + f22;
      const float d = f00 * x_m + f10 * y_m + f20, g = f01 * x_m + f11 * y_m + f21;
      const float e = a * x_m + b * y_m + c;
      return Parts{e * e, a * a + b * b + d * d + g * g};
    };
  }

 public:
  FundamentalSearch(const NormalisedMatches& matches, double limit) : matches_(matches), limit_(limit) {}

  /// Sum of inlier_worth, d^2 being e^2 / |gradient|^2.
  [[nodiscard]] float score(const Eigen::Matrix<W, 3, 3>& F, float beaten) const {
    const auto distance = sampson(F);
    const float inverse = static_cast<float>(1 / limit_);
    return matches_.sum(beaten, [=](float x, float y, float x_m, float y_m) {
      const auto [e2, g] = distance(x, y, x_m, y_m);
      return inlier_worth(e2 * inverse / (g + 1e-12F));
    });
  }
  /// Matches within the limit.
  [[nodiscard]] int inliers(const Eigen::Matrix<W, 3, 3>& F) const {
    const auto distance = sampson(F);
    const float limit = static_cast<float>(limit_);
    return static_cast<int>(matches_.sum(-1.0F, [=](float x, float y, float x_m, float y_m) {
      const auto [e2, g] = distance(x, y, x_m, y_m);
      return e2 <= limit * g ? 1.0F : 0.0F;
    }));
  }

  [[nodiscard]] std::size_t size() const { return matches_.size(); }
  [[nodiscard]] bool near(const Eigen::Matrix<W, 3, 3>& F, std::size_t i) const {
    const Eigen::Vector3d p = matches_.first(i), q = matches_.second(i);
    return sampson_distance_squared<W>(F, {p[0], p[1]}, {q[0], q[1]}) <= limit_;
  }

  /// A step of Gauss-Newton's towards the least squares of Sampson's distances, robust (Tukey's biweight).
  /// @tparam T     of the sums
  /// @param which  FirstMatches or ListedMatches
  /// @param wide   of the squared threshold, from where a match counts nothing
  template <std::floating_point T, class Which>
  [[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> step(const Eigen::Matrix<W, 3, 3>& F,
                                                           const Which& which, double wide) {
    const Eigen::Matrix<T, 3, 3> f = F.template cast<T>();
    const T f00 = f(0, 0), f01 = f(0, 1), f02 = f(0, 2), f10 = f(1, 0), f11 = f(1, 1), f12 = f(1, 2),
            f20 = f(2, 0), f21 = f(2, 1), f22 = f(2, 2);
    auto& equations = std::get<SampsonEquations<T>>(equations_);
    auto& m = equations.block();
    const T *row_x = matches_.row<T>(0), *row_y = matches_.row<T>(1), *row_x_m = matches_.row<T>(2),
            *row_y_m = matches_.row<T>(3);
    equations.set_zero();
    for (std::size_t begin = 0; begin < which.size(); begin += kMatchBlock) {
      for (std::size_t i = 0; i < kMatchBlock; ++i) {
        const std::size_t k = which(begin + i);
        const T x = row_x[k], y = row_y[k], x_m = row_x_m[k], y_m = row_y_m[k];
        const T a = f00 * x + f01 * y + f02, b = f10 * x + f11 * y + f12;
        const T c = f00 * x_m + f10 * y_m + f20, d = f01 * x_m + f11 * y_m + f21;
        m.p[0][i] = x, m.p[1][i] = y, m.p[2][i] = T(1);
        m.q[0][i] = x_m, m.q[1][i] = y_m, m.q[2][i] = T(1);
        m.h[0][i] = a, m.h[1][i] = b, m.h[2][i] = T(0);
        m.k[0][i] = c, m.k[1][i] = d, m.k[2][i] = T(0);
        m.e[i] = a * x_m + b * y_m + (f20 * x + f21 * y + f22);
        m.g[i] = a * a + b * b + c * c + d * d;
      }
      equations.add(std::min(kMatchBlock, which.size() - begin), static_cast<T>(wide * limit_));
    }
    return RankTwoStep::from<W>(F, equations);
  }

 private:
  const NormalisedMatches& matches_;
  double limit_;
  std::tuple<SampsonEquations<float>, SampsonEquations<double>> equations_;
};

/// Where most inliers of F are on a plane its sample mostly was, too, and any F of that plane's pencil was
/// taken. The one of the scene is H and two matches off the plane: [e]x H, e being where their lines cross
/// (DEGENSAC, Chum et al. 2005).
/// @param planes  the search for H
/// @param index   scratch
template <class Matches, class Search, class PlaneSearch, std::same_as<double> W = double>
void leave_plane(const Matches& matches, std::uint64_t seed, const Search& fundamental, PlaneSearch& planes,
                 BestModel<Search>& best, std::vector<int>& index) {
  constexpr int kPairs = 500;
  constexpr double kOff = 4, kConfidence = 0.99;  // squared thresholds off H that noise hardly explains
  SplitMix64 random(seed);
  const auto plane = plane_of_inliers(matches, random, fundamental, planes, best, index);
  if (!plane) return;
  const Eigen::Matrix<W, 3, 3>& H = *plane;
  index.clear();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (!planes.near(H, i, kOff)) index.push_back(static_cast<int>(i));
  }
  if (index.size() < 2) return;
  const auto off_plane_share = [&] {
    const auto agrees = [&](int i) { return fundamental.near(best.model(), static_cast<std::size_t>(i)); };
    return static_cast<double>(std::count_if(index.begin(), index.end(), agrees)) /
           static_cast<double>(index.size());
  };
  int needed = samples_needed<2>(off_plane_share(), kConfidence, kPairs);
  for (int k = 0; k < needed; ++k) {
    std::array<std::size_t, 2> pair{};
    draw_distinct(random, index.size(), pair);
    const auto line = [&](std::size_t j) {
      const auto i = static_cast<std::size_t>(index[j]);
      return Eigen::Matrix<W, 3, 1>(product<W>(H, matches.first(i)).cross(matches.second(i)));
    };
    const Eigen::Matrix<W, 3, 1> e = line(pair[0]).cross(line(pair[1]));
    const Eigen::Matrix<W, 3, 3> F = product<W>(SO3<W>::hat(e), H);
    const W norm = F.norm();
    if (norm > 0 && std::isfinite(norm) && best.consider(F / norm, 7))
      needed = std::min(needed, samples_needed<2>(off_plane_share(), kConfidence, kPairs));
  }
}

/// F by samples of seven, and away from a plane. @return iterations
template <std::floating_point S, class Matches, class Search, class PlaneSearch>
int sample_fundamentals(const Matches& matches, const RansacOptions<S>& options, const Search& search,
                        PlaneSearch& planes, BestModel<Search>& best, std::vector<int>& index) {
  const int iterations = search_models<7, S>(
      matches.size(), options, best, [&](const std::array<std::size_t, 7>& sample, const auto& consider) {
        Eigen::Matrix<double, 3, 7> p, q;
        for (std::size_t k = 0; k < 7; ++k)
          matches.copy_points(sample[k], p.data() + 3 * k, q.data() + 3 * k);
        std::array<Eigen::Matrix3d, 3> F;
        const int hypotheses = fundamental_seven_point(p, q, F);
        for (int k = 0; k < hypotheses; ++k) consider(F[static_cast<std::size_t>(k)]);
      });
  leave_plane(matches, options.seed, search, planes, best, index);
  best.draw_from_inliers(idle_draws(iterations), options.seed, index);
  best.finish();
  return iterations;
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
