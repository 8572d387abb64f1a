// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <utility>

namespace dynslam::detail {

/// The matrices M with q^T M p = 0 for K matches: a basis of these.
/// @param p, q  homogeneous points of the two images, one per column
/// @return false where the matches leave more than 9 - K
template <std::size_t K, std::same_as<double> W = double>
[[nodiscard]] bool epipolar_null_space(const Eigen::Matrix<W, 3, static_cast<int>(K)>& p,
                                       const Eigen::Matrix<W, 3, static_cast<int>(K)>& q,
                                       std::array<Eigen::Matrix<W, 3, 3>, 9 - K>& basis) {
  // A^T, a match per column. Its rows are sorted by pivots: each match takes the unknown that it says most
  // of, so that none is assumed to be independent of the others (of rectified views, two are the same).
  std::array<std::array<double, K>, 9> A;
  std::array<std::size_t, 9> unknown{};
  for (std::size_t i = 0; i < 9; ++i) {
    unknown[i] = i;
    for (std::size_t k = 0; k < K; ++k)
      A[i][k] = q(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(k)) *
                p(static_cast<Eigen::Index>(i % 3), static_cast<Eigen::Index>(k));
  }
  for (std::size_t c = 0; c < K; ++c) {  // A^T = P^T L U; the multipliers, none above 1, are L
    std::size_t pivot = c;
    for (std::size_t r = c + 1; r < 9; ++r) {
      if (std::abs(A[r][c]) > std::abs(A[pivot][c])) pivot = r;
    }
    if (!(std::abs(A[pivot][c]) > 1e-10)) return false;
    if (pivot != c) {
      std::swap(A[pivot], A[c]);
      std::swap(unknown[pivot], unknown[c]);
    }
    const double inverse = 1 / A[c][c];
    for (std::size_t r = c + 1; r < 9; ++r) {
      A[r][c] *= inverse;
      for (std::size_t i = c + 1; i < K; ++i) A[r][i] -= A[r][c] * A[c][i];
    }
  }
  // A m = 0 is L^T m = 0: as many solutions as unknowns are left, of which one each is 1 and the others 0.
  for (std::size_t free = 0; free < 9 - K; ++free) {
    std::array<double, 9> m{};
    m[K + free] = 1;
    for (std::size_t c = K; c-- > 0;) {
      double x = A[K + free][c];
      for (std::size_t r = c + 1; r < K; ++r) x += A[r][c] * m[r];
      m[c] = -x;
    }
    for (std::size_t i = 0; i < 9; ++i)
      basis[free](static_cast<Eigen::Index>(unknown[i] / 3), static_cast<Eigen::Index>(unknown[i] % 3)) =
          m[i];
  }
  return true;
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
