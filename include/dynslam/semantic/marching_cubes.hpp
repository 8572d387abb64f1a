// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/config.hpp"

// The cases of marching cubes (Lorensen and Cline 1987), computed instead of listed. Corner k of a cube is at
// (k & 1, k >> 1 & 1, k >> 2 & 1). On each face the surface is the segments that cut off its corners inside,
// each run of neighbours by one: where inside corners face each other across a face they are kept apart. That
// depends on the face's corners alone, so that neighbouring cubes agree and a surface has no holes (which the
// table of 1987 has: Duerst 1988).

namespace dynslam {

/// Three edges of a cube, on which a triangle has its vertices; counter-clockwise seen from outside of what
/// is inside.
using CubeTriangle = std::array<std::uint8_t, 3>;

/// The two corners of edge 0 to 11 of a cube, the lower one first; edges 4 a to 4 a + 3 go along axis a.
[[nodiscard]] constexpr std::pair<std::size_t, std::size_t> cube_edge(std::size_t edge) {
  const std::size_t axis = edge / 4, u = edge & 1, v = edge >> 1 & 1;
  const std::size_t low = u << (axis + 1) % 3 | v << (axis + 2) % 3;
  return {low, low | std::size_t(1) << axis};
}

namespace detail {
/// The edge between two corners that differ in one bit.
[[nodiscard]] constexpr std::uint8_t edge_between(std::size_t a, std::size_t b) {
  std::uint8_t edge = 0;
  while (cube_edge(edge) != std::pair(std::min(a, b), std::max(a, b))) ++edge;
  return edge;
}

/// Corners of a face, counter-clockwise seen from outside. @param face  2 axis + (1: the far one)
[[nodiscard]] constexpr std::array<std::size_t, 4> face_corners(std::size_t face) {
  const std::size_t axis = face / 2, far = face & 1;
  const std::size_t base = far << axis, u = std::size_t(1) << (axis + 1) % 3,
                    v = std::size_t(1) << (axis + 2) % 3;
  return far != 0 ? std::array<std::size_t, 4>{base, base | u, base | u | v, base | v}
                  : std::array<std::size_t, 4>{base, base | v, base | u | v, base | u};
}

/// Whether two edges of a cube are edges of one face: a line between them lies in it.
[[nodiscard]] constexpr bool on_one_face(std::size_t e, std::size_t f) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto side = [axis](std::size_t edge) {  // 0, 1, or 2: along the axis
      const auto [a, b] = cube_edge(edge);
      return (a >> axis & 1) == (b >> axis & 1) ? (a >> axis & 1) : 2;
    };
    if (side(e) != 2 && side(e) == side(f)) return true;
  }
  return false;
}

/// A polygon as triangles from the vertex whose diagonals lie least in faces, where a neighbouring cube may
/// have the same ones.
inline void triangulate(const std::vector<std::uint8_t>& loop, std::vector<CubeTriangle>& out) {
  const std::size_t n = loop.size();
  std::size_t best = 0, fewest = n;
  for (std::size_t apex = 0; apex < n; ++apex) {
    std::size_t on_faces = 0;
    for (std::size_t i = 2; i + 1 < n; ++i)
      on_faces += on_one_face(loop[apex], loop[(apex + i) % n]) ? 1U : 0U;
    if (on_faces < fewest) {
      fewest = on_faces;
      best = apex;
    }
  }
  for (std::size_t i = 1; i + 1 < n; ++i)
    out.push_back({loop[best], loop[(best + i) % n], loop[(best + i + 1) % n]});
}

/// Triangles of a cube. @param inside  bit k: whether corner k is
[[nodiscard]] inline std::vector<CubeTriangle> make_case(std::size_t inside) {
  constexpr std::uint8_t kNone = 12;
  // Walking around a face, the surface leaves it where the walk comes inside, and enters where that run ends.
  std::array<std::uint8_t, 12> next;
  next.fill(kNone);
  const auto is_inside = [inside](std::size_t corner) { return (inside >> corner & 1) != 0; };
  for (std::size_t face = 0; face < 6; ++face) {
    const auto corners = face_corners(face);
    for (std::size_t i = 0; i < 4; ++i) {
      if (is_inside(corners[i]) || !is_inside(corners[(i + 1) % 4])) continue;
      std::size_t j = i + 1;
      while (is_inside(corners[(j + 1) % 4])) ++j;
      next[edge_between(corners[i], corners[(i + 1) % 4])] =
          edge_between(corners[j % 4], corners[(j + 1) % 4]);
    }
  }
  std::vector<CubeTriangle> triangles;
  std::vector<std::uint8_t> loop;
  for (std::uint8_t start = 0; start < kNone; ++start) {
    loop.clear();
    for (std::uint8_t edge = start; next[edge] != kNone;) {
      loop.push_back(edge);
      edge = std::exchange(next[edge], kNone);
    }
    if (!loop.empty()) triangulate(loop, triangles);
  }
  return triangles;
}
}  // namespace detail

/// Triangles that separate the corners of a cube that are inside from the others.
/// @param inside  bit k: whether corner k is; below 256
[[nodiscard]] inline std::span<const CubeTriangle> marching_cubes_case(std::size_t inside) {
  static const auto cases = [] {
    std::array<std::vector<CubeTriangle>, 256> all;
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = detail::make_case(i);
    return all;
  }();
  DYNSLAM_ASSERT(inside < cases.size(), "a cube has 8 corners");
  return cases[inside];
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
