// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <type_traits>
#include <utility>

#include "dynslam/geometry/so3.hpp"

// Of double alone, and templates all the same: who includes them and does not call them waits for no
// compiler.

namespace dynslam {

namespace detail {
/// Real roots of a t^3 + b t^2 + c t + d; of a lower degree where `a` is tiny. @return how many
inline int real_roots(double a, double b, double c, double d, std::array<double, 3>& roots) {
  constexpr double kThird = 1.0 / 3.0, kTiny = 1e-12;
  const double largest = std::max(std::max(std::abs(a), std::abs(b)), std::max(std::abs(c), std::abs(d)));
  if (!(largest > 0) || !std::isfinite(largest)) return 0;
  if (std::abs(a) < kTiny * largest) {
    if (std::abs(b) < kTiny * largest) {
      if (std::abs(c) < kTiny * largest) return 0;
      roots[0] = -d / c;
      return 1;
    }
    const double inside = c * c - 4 * b * d;
    if (inside < 0) return 0;
    const double q = -0.5 * (c + std::copysign(std::sqrt(inside), c));
    roots[0] = q / b;
    if (q == 0) return 1;
    roots[1] = d / q;
    return 2;
  }
  b /= a;
  c /= a;
  d /= a;
  const double shift = b * kThird, p = (b * b - 3 * c) / 9, q = (b * (2 * b * b - 9 * c) + 27 * d) / 54;
  int n = 0;
  if (q * q < p * p * p) {  // three
    const double size = -2 * std::sqrt(p), angle = std::acos(q / std::sqrt(p * p * p)) * kThird;
    constexpr double kStep = 2.0943951023931953;  // a third of a turn
    for (const double offset : {0.0, kStep, -kStep})
      roots[static_cast<std::size_t>(n++)] = size * std::cos(angle + offset) - shift;
  } else {
    const double e = -std::copysign(std::cbrt(std::abs(q) + std::sqrt(q * q - p * p * p)), q);
    roots[static_cast<std::size_t>(n++)] = e + (e != 0 ? p / e : 0.0) - shift;
  }
  for (int k = 0; k < n; ++k) {  // a step of Newton's: the closed form loses digits near double roots
    double& t = roots[static_cast<std::size_t>(k)];
    const double slope = c + t * (2 * b + 3 * t);
    if (std::abs(slope) > kTiny) t -= (d + t * (c + t * (b + t))) / slope;
  }
  return n;
}
}  // namespace detail

/// The one to three F of rank 2 with q^T F p = 0 for seven matches (Hartley and Zisserman, 11.1.2), in the
/// matches' coordinates, which should be near 1 in size.
/// @param p, q  homogeneous points of the two images, one per column
/// @param F     out
/// @return how many; 0 where the matches leave more than one pencil of F
template <std::same_as<double> W = double>
[[nodiscard]] int fundamental_seven_point(const std::type_identity_t<Eigen::Matrix<W, 3, 7>>& p,
                                          const std::type_identity_t<Eigen::Matrix<W, 3, 7>>& q,
                                          std::array<std::type_identity_t<Eigen::Matrix<W, 3, 3>>, 3>& F) {
  std::array<std::array<double, 9>, 7> A;
  for (std::size_t k = 0; k < 7; ++k) {
    for (std::size_t i = 0; i < 9; ++i)
      A[k][i] = q(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(k)) *
                p(static_cast<Eigen::Index>(i % 3), static_cast<Eigen::Index>(k));
  }
  for (std::size_t c = 0; c < 7; ++c) {  // to triangular form
    std::size_t pivot = c;
    for (std::size_t r = c + 1; r < 7; ++r) {
      if (std::abs(A[r][c]) > std::abs(A[pivot][c])) pivot = r;
    }
    if (!(std::abs(A[pivot][c]) > 1e-10)) return 0;
    if (pivot != c) std::swap(A[pivot], A[c]);
    const double inverse = 1 / A[c][c];
    for (std::size_t r = c + 1; r < 7; ++r) {
      const double factor = A[r][c] * inverse;
      for (std::size_t i = c + 1; i < 9; ++i) A[r][i] -= factor * A[c][i];
    }
  }
  // Two solutions: the last two unknowns (1, 0) and (0, 1).
  std::array<std::array<double, 9>, 2> f{};
  f[0][7] = f[1][8] = 1;
  for (std::size_t c = 7; c-- > 0;) {
    double a = -A[c][7], b = -A[c][8];
    for (std::size_t i = c + 1; i < 7; ++i) {
      a -= A[c][i] * f[0][i];
      b -= A[c][i] * f[1][i];
    }
    f[0][c] = a / A[c][c];
    f[1][c] = b / A[c][c];
  }
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  Matrix3 G, H;
  for (int i = 0; i < 9; ++i) {
    G(i / 3, i % 3) = f[0][static_cast<std::size_t>(i)];
    H(i / 3, i % 3) = f[1][static_cast<std::size_t>(i)];
  }
  G /= G.norm();
  H /= H.norm();
  const Matrix3 cG = detail::cofactors(G), cH = detail::cofactors(H);
  std::array<double, 3> t{};
  const int n = detail::real_roots(G.col(0).dot(cG.col(0)), cG.cwiseProduct(H).sum(),
                                   cH.cwiseProduct(G).sum(), H.col(0).dot(cH.col(0)), t);
  for (int k = 0; k < n; ++k) {
    Matrix3& m = F[static_cast<std::size_t>(k)];
    for (int i = 0; i < 9; ++i) m.data()[i] = t[static_cast<std::size_t>(k)] * G.data()[i] + H.data()[i];
    m /= m.norm();
  }
  return n;
}

/// The H with q ~ H p for four matches, by way of the projective basis that each image's four points are.
/// @param p, q  homogeneous points of the two images, one per column
/// @return nullopt where three of the points are on a line, and where no camera sees the four in this order
///         from one side of a plane
template <std::same_as<double> W = double>
[[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> homography_four_point(
    const std::type_identity_t<Eigen::Matrix<W, 3, 4>>& p,
    const std::type_identity_t<Eigen::Matrix<W, 3, 4>>& q) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Vector3 = Eigen::Matrix<W, 3, 1>;
  Matrix3 basis[2], inverse[2];
  Vector3 weight[2];
  for (int side = 0; side < 2; ++side) {
    const auto& points = side == 0 ? p : q;
    Matrix3& m = basis[side];
    for (int i = 0; i < 9; ++i) m.data()[i] = points.data()[i];
    const Matrix3 adjugate = detail::cofactors(m).transpose();
    const double determinant =
        adjugate(0, 0) * m(0, 0) + (adjugate(0, 1) * m(1, 0) + adjugate(0, 2) * m(2, 0));
    if (!(std::abs(determinant) > 1e-6)) return std::nullopt;
    weight[side] = detail::product<W>(adjugate, Vector3(points(0, 3), points(1, 3), points(2, 3)));
    for (int i = 0; i < 3; ++i) {
      weight[side][i] /= determinant;
      if (!(std::abs(weight[side][i]) > 1e-6)) return std::nullopt;
    }
    for (int i = 0; i < 9; ++i) inverse[side].data()[i] = adjugate.data()[i] / determinant;
  }
  for (int c = 0; c < 3; ++c) {
    const double ratio = weight[1][c] / weight[0][c];
    if (!(ratio > 0)) return std::nullopt;
    for (int r = 0; r < 3; ++r) basis[1](r, c) *= ratio;
  }
  Matrix3 H = detail::product<W>(basis[1], inverse[0]);
  H /= H.norm();
  return H;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
