// SPDX-License-Identifier: BSD-3-Clause
#include "synth/solids.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace dynslam::runtime::synth {
namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;

Triangle triangle(const std::array<Vector3d, 3>& p, const std::array<Eigen::Vector2d, 3>& uv,
                  const Vector3d& normal, int texture, const Tag& tag) {
  return {p, uv, normal, texture, tag.label, tag.instance, tag.dynamic, tag.box};
}

}  // namespace

void quad(std::vector<Triangle>& out, const std::array<Vector3d, 4>& p, int texture, const Tag& tag) {
  const double w = (p[1] - p[0]).norm(), h = (p[3] - p[0]).norm();
  const std::array<Eigen::Vector2d, 4> uv{Eigen::Vector2d(0, h), Eigen::Vector2d(w, h), Eigen::Vector2d(w, 0),
                                          Eigen::Vector2d(0, 0)};
  const Vector3d n = (p[1] - p[0]).cross(p[3] - p[0]).normalized();
  for (const auto& [a, b, c] : {std::array{0, 1, 2}, std::array{0, 2, 3}}) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b),
               k = static_cast<std::size_t>(c);
    out.push_back(triangle({p[i], p[j], p[k]}, {uv[i], uv[j], uv[k]}, n, texture, tag));
  }
}

void box(std::vector<Triangle>& out, const Affine3d& T, const Vector3d& size, int texture, const Tag& tag,
         int front) {
  const Vector3d h = size / 2;
  const auto p = [&](int x, int y, int z) { return Vector3d(T * Vector3d(x * h.x(), y * h.y(), z * h.z())); };
  quad(out, {p(-1, -1, -1), p(1, -1, -1), p(1, -1, 1), p(-1, -1, 1)}, front >= 0 ? front : texture, tag);
  quad(out, {p(1, 1, -1), p(-1, 1, -1), p(-1, 1, 1), p(1, 1, 1)}, texture, tag);
  quad(out, {p(-1, 1, -1), p(-1, -1, -1), p(-1, -1, 1), p(-1, 1, 1)}, texture, tag);
  quad(out, {p(1, -1, -1), p(1, 1, -1), p(1, 1, 1), p(1, -1, 1)}, texture, tag);
  quad(out, {p(-1, -1, 1), p(1, -1, 1), p(1, 1, 1), p(-1, 1, 1)}, texture, tag);
  quad(out, {p(-1, 1, -1), p(1, 1, -1), p(1, -1, -1), p(-1, -1, -1)}, texture, tag);
}

void limb(std::vector<Triangle>& out, const Vector3d& a, const Vector3d& b, double ra, double rb, int texture,
          const Tag& tag) {
  // A capsule with two radii: rings along the axis, half a sphere at each end.
  constexpr int kSides = 12, kCap = 3;
  const Vector3d axis = (b - a).normalized();
  const Vector3d side =
      (std::abs(axis.y()) < 0.9 ? axis.cross(Vector3d::UnitY()) : axis.cross(Vector3d::UnitX())).normalized();
  const Vector3d other = axis.cross(side);
  struct Ring {
    Vector3d centre;
    double radius, along;
  };
  std::vector<Ring> rings;
  const double length = (b - a).norm();
  for (int i = 0; i <= kCap; ++i) {
    const double t = std::numbers::pi / 2 * i / kCap;
    rings.push_back({a - axis * ra * std::cos(t), ra * std::sin(t), -ra * std::cos(t)});
  }
  for (int i = kCap; i >= 0; --i) {
    const double t = std::numbers::pi / 2 * i / kCap;
    rings.push_back({b + axis * rb * std::cos(t), rb * std::sin(t), length + rb * std::cos(t)});
  }
  for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
    for (int s = 0; s < kSides; ++s) {
      const auto point = [&](const Ring& ring, int k) {
        const double t = 2 * std::numbers::pi * k / kSides;
        return Vector3d(ring.centre + ring.radius * (std::cos(t) * side + std::sin(t) * other));
      };
      const auto uv = [&](const Ring& ring, int k) {
        return Eigen::Vector2d(2 * std::numbers::pi * k / kSides * std::max(ra, rb), ring.along);
      };
      const std::array<Vector3d, 4> p{point(rings[r], s), point(rings[r], s + 1), point(rings[r + 1], s + 1),
                                      point(rings[r + 1], s)};
      const std::array<Eigen::Vector2d, 4> t{uv(rings[r], s), uv(rings[r], s + 1), uv(rings[r + 1], s + 1),
                                             uv(rings[r + 1], s)};
      const Vector3d middle = (p[0] + p[1] + p[2] + p[3]) / 4;
      const Vector3d n = (middle - (rings[r].centre + rings[r + 1].centre) / 2).normalized();
      out.push_back(triangle({p[0], p[1], p[2]}, {t[0], t[1], t[2]}, n, texture, tag));
      out.push_back(triangle({p[0], p[2], p[3]}, {t[0], t[2], t[3]}, n, texture, tag));
    }
  }
}

}  // namespace dynslam::runtime::synth
