// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/detail/growing_field.hpp"
#include "dynslam/segment/region_growing.hpp"

namespace dynslam {

/// Options of split_supports().
struct SupportPlaneOptions {
  int least = 200;       ///< pixels of the smallest surface that is split
  double area = 1.0;     ///< of the smallest plane that supports others: no side of a person has as much [m^2]
  int planes = 3;        ///< of a surface, at most
  int hypotheses = 100;  ///< by three pixels each: of planes that a quarter of the pixels are on, 79 % are found in a frame
  int samples = 300;     ///< pixels that judge them
  float base = 0.03F, quad = 0.010F;  ///< a pixel at depth z is on the plane within base + quad z^2 [m, 1/m]
  [[nodiscard]] float tolerance(float z) const { return base + quad * z * z; }  ///< [m]
};

/// Memory of split_supports(); keep it between calls to avoid allocation.
struct SupportPlaneWorkspace {
  RegionGrowingWorkspace growing;
  std::vector<PixelRun> runs;
  std::vector<PixelIndex> rest;
  std::vector<float> u, v, z, tolerance;  // of the pixels that judge planes
};

namespace detail {
/// A plane as a pinhole sees it: 1 / z = a u + b v + c.
struct InverseDepthPlane {
  Eigen::Vector3f abc = Eigen::Vector3f::Zero();
  /// Whether a pixel of depth z lies on it.
  /// @param tolerance  SupportPlaneOptions::tolerance(z)
  [[nodiscard]] bool holds(float u, float v, float z, float tolerance) const {
    const float inverse = abc.x() * u + abc.y() * v + abc.z();
    // |z - 1 / inverse| < tolerance, without the division; behind the camera there is no plane.
    const bool ahead = inverse > 0, near = std::abs(z * inverse - 1) < tolerance * inverse;
    return (static_cast<int>(ahead) & static_cast<int>(near)) != 0;  // no branch: it is tried on many
  }
  /// What a pixel at depth 1 m shows of it [m^2]; at depth z it is z^3 times as much.
  template <class Pinhole>
  [[nodiscard]] float area_at_one(const Pinhole& k) const {
    const Eigen::Vector3f normal(k.fx() * abc.x(), k.fy() * abc.y(), abc.dot(Eigen::Vector3f(k.cx(), k.cy(), 1)));
    return normal.norm() / (k.fx() * k.fy());
  }
};

/// The plane through most of n of `ws.rest`, evenly taken, by three of them at a time.
inline InverseDepthPlane dominant_plane(const Image<float>& depth, std::size_t n,
                                        const SupportPlaneOptions& o, SupportPlaneWorkspace& ws) {
  // Side by side, so that a plane is tried on several at once.
  for (auto* values : {&ws.u, &ws.v, &ws.z, &ws.tolerance}) values->resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const PixelIndex p = ws.rest[i * ws.rest.size() / n];
    const float z = depth(p.u, p.v);
    ws.u[i] = static_cast<float>(p.u), ws.v[i] = static_cast<float>(p.v), ws.z[i] = z;
    ws.tolerance[i] = o.tolerance(z);
  }
  InverseDepthPlane best;
  int most = 0;
  std::uint32_t state = 1;  // the same draws in every call: results can be reproduced
  const auto draw = [&] {
    state = state * 1664525U + 1013904223U;
    return static_cast<std::size_t>((std::uint64_t(state) * n) >> 32);
  };
  for (int k = 0; k < o.hypotheses; ++k) {
    Eigen::Matrix3f A;
    Eigen::Vector3f inverse;
    for (int i = 0; i < 3; ++i) {
      const std::size_t p = draw();
      A.row(i) << ws.u[p], ws.v[p], 1.0F;
      inverse[i] = 1.0F / ws.z[p];
    }
    if (std::abs(A.determinant()) < 1.0F) continue;  // on one line
    const InverseDepthPlane plane{A.inverse() * inverse};
    int inliers = 0;
    for (std::size_t i = 0; i < n; ++i)
      inliers += static_cast<int>(plane.holds(ws.u[i], ws.v[i], ws.z[i], ws.tolerance[i]));
    if (inliers > most) most = inliers, best = plane;
  }
  return best;
}
}  // namespace detail

/// Numbers the large planes of a depth image's connected surfaces: floors, walls and tables. Depth is continuous where a
/// person stands on a floor or a back touches a wall, but what touches a plane does not lie on it.
/// @param pinhole  of the depth image: fx(), fy(), cx(), cy() [px]
/// @param depth    [m], invalid = NaN or <= 0
/// @param step     between pixels of one surface, as RelativeStep
/// @param plane    out: number of its pixel's plane, from 1; 0: none, or one that holds less than a quarter of what is left
///                 of its surface or is smaller than `options.area`
template <class Pinhole, class Step>
void split_supports(const Pinhole& pinhole, const Image<float>& depth, const Step& step,
                    const SupportPlaneOptions& options, Image<int>& plane, SupportPlaneWorkspace& ws) {
  const detail::NoBarrier nowhere;
  detail::GrowingField field(depth, nowhere, step, ws.growing.words);
  plane.resize(depth.width(), depth.height());
  plane.fill(0);
  int planes = 0;
  for (int v = 0; v < depth.height(); ++v) {
    for (int u = 0; u < depth.width(); ++u) {
      if (!field.open(u, v)) continue;
      ws.runs.clear();
      ws.rest.clear();
      field.template take_region<Connectivity::four>(u, v, ws.runs);
      for (const PixelRun& run : ws.runs) {
        for (int x = run.begin; x < run.end; ++x) ws.rest.push_back({x, run.v});
      }
      for (int k = 0; k < options.planes && ws.rest.size() >= static_cast<std::size_t>(options.least); ++k) {
        const auto n = std::min(ws.rest.size(), static_cast<std::size_t>(options.samples));
        const detail::InverseDepthPlane found = detail::dominant_plane(depth, n, options, ws);
        const auto off = [&](const PixelIndex& p) {
          const float z = depth(p.u, p.v);
          return !found.holds(static_cast<float>(p.u), static_cast<float>(p.v), z, options.tolerance(z));
        };
        std::size_t on = 0;
        double cubes = 0;
        for (const PixelIndex& p : ws.rest) {
          if (off(p)) continue;
          const auto z = static_cast<double>(depth(p.u, p.v));
          ++on;
          cubes += z * z * z;
        }
        if (4 * on < ws.rest.size() || cubes * static_cast<double>(found.area_at_one(pinhole)) < options.area) break;
        ++planes;
        std::erase_if(ws.rest, [&](const PixelIndex& p) {
          if (off(p)) return false;
          plane(p.u, p.v) = planes;
          return true;
        });
      }
    }
  }
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
