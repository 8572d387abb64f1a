// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "dynslam/geometry/detail/epipolar_null_space.hpp"
#include "dynslam/geometry/detail/polynomial_roots.hpp"
#include "dynslam/geometry/so3.hpp"

// Of double alone, and templates all the same: who includes them and does not call them waits for no
// compiler.

namespace dynslam {

namespace detail {

/// Exponents of x, y and z. Polynomials of degree 1, 2 and 3 are coefficients of these monomials. The order
/// of the cubic ones is Nister's: when the first ten are eliminated, x and y are left to the power of one at
/// most, with polynomials in z.
struct Monomial {
  int x, y, z;
};
inline constexpr std::array<Monomial, 4> kLinear{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}};
inline constexpr std::array<Monomial, 10> kQuadratic{{{2, 0, 0},
                                                      {1, 1, 0},
                                                      {1, 0, 1},
                                                      {1, 0, 0},
                                                      {0, 2, 0},
                                                      {0, 1, 1},
                                                      {0, 1, 0},
                                                      {0, 0, 2},
                                                      {0, 0, 1},
                                                      {0, 0, 0}}};
inline constexpr std::array<Monomial, 20> kCubic{{{3, 0, 0}, {0, 3, 0}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1},
                                                  {2, 0, 0}, {0, 2, 1}, {0, 2, 0}, {1, 1, 1}, {1, 1, 0},
                                                  {1, 0, 2}, {1, 0, 1}, {1, 0, 0}, {0, 1, 2}, {0, 1, 1},
                                                  {0, 1, 0}, {0, 0, 3}, {0, 0, 2}, {0, 0, 1}, {0, 0, 0}}};

/// Where in `c` the product of a monomial of `a` and a linear one stands.
template <std::size_t A, std::size_t C>
[[nodiscard]] constexpr std::array<std::array<std::size_t, 4>, A> products_with_linear(
    const std::array<Monomial, A>& a, const std::array<Monomial, C>& c) {
  std::array<std::array<std::size_t, 4>, A> at{};
  for (std::size_t i = 0; i < A; ++i) {
    for (std::size_t k = 0; k < 4; ++k) {
      const Monomial& b = kLinear[k];
      for (std::size_t j = 0; j < C; ++j) {
        if (c[j].x == a[i].x + b.x && c[j].y == a[i].y + b.y && c[j].z == a[i].z + b.z) at[i][k] = j;
      }
    }
  }
  return at;
}
inline constexpr auto kQuadraticOf = products_with_linear(kLinear, kQuadratic);
inline constexpr auto kCubicOf = products_with_linear(kQuadratic, kCubic);

using LinearForm = std::array<double, 4>;
using QuadraticForm = std::array<double, 10>;
using CubicForm = std::array<double, 20>;

/// sum += scale a b.
inline void add_product(double scale, const LinearForm& a, const LinearForm& b, QuadraticForm& sum) {
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t k = 0; k < 4; ++k) sum[kQuadraticOf[i][k]] += scale * a[i] * b[k];
  }
}
inline void add_product(double scale, const QuadraticForm& a, const LinearForm& b, CubicForm& sum) {
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t k = 0; k < 4; ++k) sum[kCubicOf[i][k]] += scale * a[i] * b[k];
  }
}

/// det E = 0 and 2 E E^T E - tr(E E^T) E = 0 for E = x E_0 + y E_1 + z E_2 + E_3: ten cubics.
template <std::same_as<double> W>
void essential_constraints(const std::array<Eigen::Matrix<W, 3, 3>, 4>& basis,
                           std::array<CubicForm, 10>& cubics) {
  std::array<std::array<LinearForm, 3>, 3> E;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 4; ++k)
        E[r][c][k] = basis[k](static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
    }
  }
  std::array<std::array<QuadraticForm, 3>, 3> square;  // E E^T - tr / 2
  QuadraticForm half_trace{};
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = r; c < 3; ++c) {
      square[r][c] = {};
      for (std::size_t k = 0; k < 3; ++k) add_product(1, E[r][k], E[c][k], square[r][c]);
      square[c][r] = square[r][c];
    }
    for (std::size_t i = 0; i < half_trace.size(); ++i) half_trace[i] += 0.5 * square[r][r][i];
  }
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t i = 0; i < half_trace.size(); ++i) square[r][r][i] -= half_trace[i];
  }
  for (auto& cubic : cubics) cubic = {};
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k) add_product(1, square[r][k], E[k][c], cubics[3 * r + c]);
    }
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t c1 = (c + 1) % 3, c2 = (c + 2) % 3;
    QuadraticForm minor{};
    add_product(1, E[1][c1], E[2][c2], minor);
    add_product(-1, E[1][c2], E[2][c1], minor);
    add_product(1, minor, E[0][c], cubics[9]);
  }
}

/// Gauss-Jordan with pivots, so far as Nister's method needs it: of the first ten columns, the last six rows
/// become those of the identity. @return false where there is no pivot
inline bool eliminate(std::array<CubicForm, 10>& rows) {
  constexpr std::size_t kNeeded = 4;
  for (std::size_t c = 0; c < 10; ++c) {
    std::size_t pivot = c;
    for (std::size_t r = c + 1; r < 10; ++r) {
      if (std::abs(rows[r][c]) > std::abs(rows[pivot][c])) pivot = r;
    }
    if (!(std::abs(rows[pivot][c]) > 1e-14)) return false;
    std::swap(rows[pivot], rows[c]);
    const double inverse = 1 / rows[c][c];
    for (std::size_t k = c; k < 20; ++k) rows[c][k] *= inverse;
    for (std::size_t r = std::min(kNeeded, c + 1); r < 10; ++r) {
      if (r == c) continue;
      const double factor = rows[r][c];
      for (std::size_t k = c; k < 20; ++k) rows[r][k] -= factor * rows[c][k];
    }
  }
  return true;
}

/// Polynomials in z, the constant first.
template <std::size_t A, std::size_t B>
[[nodiscard]] std::array<double, A + B - 1> times(const std::array<double, A>& a,
                                                  const std::array<double, B>& b) {
  std::array<double, A + B - 1> product{};
  for (std::size_t i = 0; i < A; ++i) {
    for (std::size_t k = 0; k < B; ++k) product[i + k] += a[i] * b[k];
  }
  return product;
}
template <std::size_t A>
[[nodiscard]] std::array<double, A> minus(std::array<double, A> a, const std::array<double, A>& b) {
  for (std::size_t i = 0; i < A; ++i) a[i] -= b[i];
  return a;
}

/// x p(z) + y q(z) + r(z) = 0.
struct Depressed {
  std::array<double, 4> x, y;
  std::array<double, 5> one;
};
/// Row `upper` less z times row `lower`, of which the first ten columns are gone.
[[nodiscard]] inline Depressed depressed(const CubicForm& upper, const CubicForm& lower) {
  Depressed row;
  const auto fill = [&](std::size_t highest, auto& to) {  // columns from the highest power of z on
    const std::size_t degree = to.size() - 1;
    for (std::size_t k = 0; k <= degree; ++k) {
      const double from_upper = k < degree ? upper[highest + degree - 1 - k] : 0.0,
                   from_lower = k > 0 ? lower[highest + degree - k] : 0.0;
      to[k] = from_upper - from_lower;
    }
  };
  fill(10, row.x);
  fill(13, row.y);
  fill(16, row.one);
  return row;
}

}  // namespace detail

/// The essential matrices with q^T E p = 0 for five matches (Nister 2004), of norm 1, in `E`. A plane is no
/// degenerate case.
/// @param p, q  rays of the two images, one per column
/// @return how many: up to 10; 0 where the matches leave more than four unknowns
template <std::same_as<double> W = double>
[[nodiscard]] int essential_five_point(const std::type_identity_t<Eigen::Matrix<W, 3, 5>>& p,
                                       const std::type_identity_t<Eigen::Matrix<W, 3, 5>>& q,
                                       std::array<std::type_identity_t<Eigen::Matrix<W, 3, 3>>, 10>& E) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  std::array<Matrix3, 4> basis;
  if (!detail::epipolar_null_space<5>(p, q, basis)) return 0;
  for (std::size_t i = 0; i < 4; ++i) {  // orthonormal
    for (std::size_t k = 0; k < i; ++k) basis[i] -= basis[i].cwiseProduct(basis[k]).sum() * basis[k];
    basis[i] /= basis[i].norm();
  }
  // And turned: of a step along an axis many numbers of E are 0, and it would be at infinity.
  constexpr std::array<W, 4> kMirror{0.7, -0.1, 0.5, 0.5};  // of norm 1
  const Matrix3 mirrored =
      kMirror[0] * basis[0] + kMirror[1] * basis[1] + kMirror[2] * basis[2] + kMirror[3] * basis[3];
  for (std::size_t i = 0; i < 4; ++i) basis[i] -= 2 * kMirror[i] * mirrored;
  std::array<detail::CubicForm, 10> rows;
  detail::essential_constraints<W>(basis, rows);
  if (!detail::eliminate(rows)) return 0;
  const std::array<detail::Depressed, 3> B{detail::depressed(rows[4], rows[5]),
                                           detail::depressed(rows[6], rows[7]),
                                           detail::depressed(rows[8], rows[9])};
  const auto minor = [&](const auto& first, const auto& second) {  // of the last two rows
    return detail::minus(detail::times(first(B[1]), second(B[2])), detail::times(second(B[1]), first(B[2])));
  };
  const auto x = [](const detail::Depressed& row) { return row.x; };
  const auto y = [](const detail::Depressed& row) { return row.y; };
  const auto one = [](const detail::Depressed& row) { return row.one; };
  const std::array<double, 11> of_x = detail::times(B[0].x, minor(y, one)),
                               of_y = detail::times(B[0].y, minor(x, one)),
                               of_one = detail::times(B[0].one, minor(x, y));
  std::array<double, 11> determinant;
  for (std::size_t i = 0; i < 11; ++i) determinant[i] = of_x[i] - of_y[i] + of_one[i];
  std::array<double, 10> roots{};
  const int n = detail::polynomial_roots(determinant, roots);
  int found = 0;
  for (int k = 0; k < n; ++k) {
    const double z = roots[static_cast<std::size_t>(k)];
    Matrix3 at;  // B(z), a row per column
    for (int r = 0; r < 3; ++r) {
      const detail::Depressed& row = B[static_cast<std::size_t>(r)];
      at(0, r) = detail::value_of(row.x, z);
      at(1, r) = detail::value_of(row.y, z);
      at(2, r) = detail::value_of(row.one, z);
    }
    Eigen::Matrix<W, 3, 1> best = Eigen::Matrix<W, 3, 1>::Zero();
    for (int r = 0; r < 3; ++r) {
      const Eigen::Matrix<W, 3, 1> across = at.col(r).cross(at.col((r + 1) % 3));
      if (across.squaredNorm() > best.squaredNorm()) best = across;
    }
    // With (x, y, 1) the null vector, of any size: no division by what may be near zero.
    const Matrix3 solution = best[0] * basis[0] + best[1] * basis[1] + best[2] * (z * basis[2] + basis[3]);
    const double norm = solution.norm();
    if (!(norm > 0) || !std::isfinite(norm)) continue;
    const Matrix3 e = solution / norm, square = detail::product<W>(e, Matrix3(e.transpose()));
    if (!((2 * square * e - square.trace() * e).norm() < 1e-3)) continue;  // near a double root
    E[static_cast<std::size_t>(found++)] = e;
  }
  return found;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
