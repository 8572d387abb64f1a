// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>

#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/small_cholesky.hpp"
#include "dynslam/geometry/so3.hpp"

namespace dynslam::detail {

/// Gauss-Newton equations of Sampson's distances e^2 / g, e being q^T F p and g the squared norm of its
/// gradient, by the nine numbers of F, row by row, with Tukey's weights (1 - part)^2. Collected in blocks of
/// T, float where speed matters and double where the last digits do.
template <std::floating_point T>
class SampsonEquations {
 public:
  using Row = std::array<T, kMatchBlock>;
  using Vector = std::array<Row, 3>;
  /// A block of matches. Half of g changes with F by h p^T + q k^T.
  struct Block {
    Vector p, q, h, k;
    Row e, g;
  };

  void set_zero() {
    A_.setZero();
    b_.setZero();
  }
  /// To be filled before add().
  [[nodiscard]] Block& block() { return block_; }
  /// Adds the first `size` matches of the block. @param limit  squared distance from which they count nothing
  void add(std::size_t size, T limit) {
    const Block& m = block_;
    Row slope, weight;
    const T inverse_limit = T(1) / limit;
    for (std::size_t i = 0; i < kMatchBlock; ++i) {
      const T inverse = T(1) / (m.g[i] + T(1e-30));
      slope[i] = m.e[i] * inverse;
      const T part = slope[i] * m.e[i] * inverse_limit, left = T(1) - part,
              kept = T(0.5) * (left + std::abs(left));
      weight[i] = kept * kept * inverse;
    }
    for (std::size_t i = size; i < kMatchBlock; ++i) weight[i] = T(0);
    std::array<Row, 9> rows, weighted;
    Vector steep;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < kMatchBlock; ++i) steep[c][i] = slope[i] * m.k[c][i];
    }
    for (std::size_t r = 0; r < 3; ++r) {
      Row across;
      for (std::size_t i = 0; i < kMatchBlock; ++i) across[i] = m.q[r][i] - slope[i] * m.h[r][i];
      for (std::size_t c = 0; c < 3; ++c) {
        Row &row = rows[3 * r + c], &by_weight = weighted[3 * r + c];
        for (std::size_t i = 0; i < kMatchBlock; ++i) {
          row[i] = across[i] * m.p[c][i] - m.q[r][i] * steep[c][i];
          by_weight[i] = weight[i] * row[i];
        }
      }
    }
    for (std::size_t r = 0; r < 9; ++r) {
      const auto at = static_cast<Eigen::Index>(r);
      for (std::size_t c = 0; c <= r; ++c) A_(at, static_cast<Eigen::Index>(c)) += dot(rows[r], weighted[c]);
      b_[at] += dot(weighted[r], m.e);
    }
  }
  /// J^T J and J^T r.
  [[nodiscard]] Eigen::Matrix<double, 9, 9> A() const {
    Eigen::Matrix<double, 9, 9> whole = A_;
    for (int c = 1; c < 9; ++c) {
      for (int r = 0; r < c; ++r) whole(r, c) = A_(c, r);
    }
    return whole;
  }
  [[nodiscard]] const Eigen::Matrix<double, 9, 1>& b() const { return b_; }

 private:
  [[nodiscard]] static double dot(const Row& a, const Row& b) {
    std::array<T, 16> lanes{};
    for (std::size_t i = 0; i < kMatchBlock; i += 16) {
      for (std::size_t k = 0; k < 16; ++k) lanes[k] += a[i + k] * b[i + k];
    }
    for (const std::size_t half : {8U, 4U, 2U, 1U}) {
      for (std::size_t k = 0; k < half; ++k) lanes[k] += lanes[k + half];
    }
    return static_cast<double>(lanes[0]);
  }
  Block block_{};
  Eigen::Matrix<double, 9, 9> A_ = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 1> b_ = Eigen::Matrix<double, 9, 1>::Zero();
};

/// A step of Gauss-Newton's among the matrices of rank 2 and norm 1: neither along F nor along its cofactors,
/// which are what the rank grows by.
struct RankTwoStep {
  template <std::same_as<double> W, std::floating_point T>
  [[nodiscard]] static std::optional<Eigen::Matrix<W, 3, 3>> from(const Eigen::Matrix<W, 3, 3>& F,
                                                                  const SampsonEquations<T>& equations) {
    using Matrix3 = Eigen::Matrix<W, 3, 3>;
    using Matrix9 = Eigen::Matrix<W, 9, 9>;
    using Vector9 = Eigen::Matrix<W, 9, 1>;
    const Vector9 f = as_vector(F).normalized(), n = as_vector<W>(cofactors(F)).normalized();
    Matrix9 A = equations.A();
    Vector9 An = Vector9::Zero();
    W mean = 0, nAn = 0;
    for (int c = 0; c < 9; ++c) {
      for (int r = 0; r < 9; ++r) An[r] += A(r, c) * n[c];
      mean += A(c, c) / 9;
    }
    for (int r = 0; r < 9; ++r) nAn += n[r] * An[r];
    for (int c = 0; c < 9; ++c) {
      for (int r = 0; r < 9; ++r)
        A(r, c) += (nAn + mean) * n[r] * n[c] - An[r] * n[c] - n[r] * An[c] + mean * f[r] * f[c];
      A(c, c) += W(1e-12) * mean;
    }
    SmallCholesky<W, 9> factors;
    if (!factors.compute(A)) return std::nullopt;
    const Vector9 step = factors.solve(n * n.dot(equations.b()) - equations.b());
    Matrix3 next = F / F.norm() + as_matrix<W>(step);
    for (int i = 0; i < 2; ++i) {  // Newton's for det = 0
      const Matrix3 c = cofactors(next);
      next -= (next.col(0).dot(c.col(0)) / c.squaredNorm()) * c;
    }
    next /= next.norm();
    return next.allFinite() ? std::optional<Matrix3>(next) : std::nullopt;
  }
};

/// A step of Gauss-Newton's among the essential matrices: E turned from both sides.
struct EssentialStep {
  template <std::same_as<double> W, std::floating_point T>
  [[nodiscard]] static std::optional<Eigen::Matrix<W, 3, 3>> from(const Eigen::Matrix<W, 3, 3>& E,
                                                                  const SampsonEquations<T>& equations) {
    using Matrix3 = Eigen::Matrix<W, 3, 3>;
    Eigen::Matrix<W, 9, 6> turns;
    for (int k = 0; k < 3; ++k) {
      const Matrix3 hat = SO3<W>::hat(Eigen::Matrix<W, 3, 1>::Unit(k));
      turns.col(k) = as_vector<W>(product<W>(hat, E));
      turns.col(k + 3) = as_vector<W>(product<W>(E, hat));
    }
    Eigen::Matrix<W, 6, 6> A = turns.transpose() * equations.A() * turns;
    // Five numbers determine E: one combination of the turns changes nothing.
    A.diagonal().array() += W(1e-10) * A.trace();
    SmallCholesky<W, 6> factors;
    if (!factors.compute(A)) return std::nullopt;
    const Eigen::Matrix<W, 6, 1> step = -factors.solve(turns.transpose() * equations.b());
    const Matrix3 left = SO3<W>::exp(step.template head<3>()).matrix(),
                  right = SO3<W>::exp(step.template tail<3>()).matrix();
    const Matrix3 next = product<W>(product<W>(left, E), right);
    return next.allFinite() ? std::optional<Matrix3>(next) : std::nullopt;
  }
};

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
