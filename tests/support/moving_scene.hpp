// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam::test {

/// An image that the library does not know: column after column, which no row pointer can give.
template <class T>
struct ColumnImage {
  using Pixel = T;
  int w = 0, h = 0;
  std::vector<T> pixels;
  explicit ColumnImage(const Image<T>& image) : w(image.width()), h(image.height()) {
    for (int u = 0; u < w; ++u) {
      for (int v = 0; v < h; ++v) pixels.push_back(image(u, v));
    }
  }
  [[nodiscard]] int width() const { return w; }
  [[nodiscard]] int height() const { return h; }
  [[nodiscard]] T operator()(int u, int v) const { return pixels[static_cast<std::size_t>(u * h + v)]; }
};

/// Smooth noise of wavelengths from 6 cm on, 0 to 1.
inline double surface_texture(double x, double y, std::uint64_t seed) {
  const auto lattice = [seed](std::int64_t i, std::int64_t j) {
    std::uint64_t z = seed + static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL +
                      static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FULL;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return static_cast<double>((z ^ (z >> 31)) >> 40) / static_cast<double>(1 << 24);
  };
  double value = 0, weight = 0.6;
  for (const double cell : {0.12, 0.06}) {
    const double i = std::floor(x / cell), j = std::floor(y / cell);
    const double a = x / cell - i, b = y / cell - j;
    const double s = a * a * (3 - 2 * a), t = b * b * (3 - 2 * b);
    const auto k = static_cast<std::int64_t>(i), l = static_cast<std::int64_t>(j);
    const double top = lattice(k, l) * (1 - s) + lattice(k + 1, l) * s;
    const double bottom = lattice(k, l + 1) * (1 - s) + lattice(k + 1, l + 1) * s;
    value += weight * (top * (1 - t) + bottom * t);
    weight = 1 - weight;
  }
  return value;
}

/// Grey values of a picture: blobs of 30, 15 and 7 pixels, 10 to 190.
inline double blob_texture(double u, double v, std::uint64_t seed) {
  const auto at = [&](double pixels) { return 90 * surface_texture(u / pixels, v / pixels, seed); };
  return 10 + at(250) + at(125);
}

/// A wall with two boards in front of it, facing along z: one that stands, one that may be carried about.
struct MovingScene {
  Eigen::Vector2d board{-0.3, 0.0};  ///< centre of the one that moves [m]
  Eigen::Vector2d standing{0.7, 0.1};
  double board_z = 1.8, standing_z = 2.2, wall_z = 3.0, half = 0.35;
  double gain = 1, offset = 0;  ///< of the exposure
};

template <class Camera>
class SceneRenderer {
 public:
  using S = typename Camera::ScalarType;
  SceneRenderer(const Camera& camera, int width, int height)
      : gray(width, height),
        depth(width, height),
        moving(width, height),
        rays_(width, height, Eigen::Vector3d::Zero()) {
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const auto ray = camera.unproject(Eigen::Matrix<S, 2, 1>(S(u), S(v)), S(1));
        if (ray) rays_(u, v) = ray->template cast<double>();
      }
    }
  }

  /// Fills gray, depth and moving (the board's mask), seen from T_w_c.
  void render(const MovingScene& scene, const SE3<double>& T_w_c) {
    const Eigen::Matrix3d R = T_w_c.rotation_matrix();
    const Eigen::Vector3d o = T_w_c.translation();
    for (int v = 0; v < gray.height(); ++v) {
      for (int u = 0; u < gray.width(); ++u) {
        depth(u, v) = std::numeric_limits<float>::quiet_NaN();
        gray(u, v) = moving(u, v) = 0;
        const Eigen::Vector3d d = R * rays_(u, v);  // a camera's z of 1
        if (!(d.z() > 0.05)) continue;
        const auto look = [&](double z, const Eigen::Vector2d* centre, std::uint64_t seed, bool moves) {
          const double t = (z - o.z()) / d.z();
          const Eigen::Vector2d p = (o + t * d).head<2>();
          const Eigen::Vector2d q = centre != nullptr ? Eigen::Vector2d(p - *centre) : p;
          if (centre != nullptr && q.cwiseAbs().maxCoeff() > scene.half) return false;
          const double grey = scene.gain * (30 + 190 * surface_texture(q.x(), q.y(), seed)) + scene.offset;
          gray(u, v) = static_cast<std::uint8_t>(std::lround(std::min(255.0, std::max(0.0, grey))));
          depth(u, v) = static_cast<float>(t);
          moving(u, v) = moves ? 255 : 0;
          return true;
        };
        look(scene.board_z, &scene.board, 1, true) || look(scene.standing_z, &scene.standing, 2, false) ||
            look(scene.wall_z, nullptr, 3, false);
      }
    }
  }

  Image<std::uint8_t> gray;
  Image<float> depth;
  Image<std::uint8_t> moving;

 private:
  Image<Eigen::Vector3d> rays_;
};

}  // namespace dynslam::test
