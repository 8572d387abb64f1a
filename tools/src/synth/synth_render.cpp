// SPDX-License-Identifier: BSD-3-Clause
#include "synth/synth_render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace dynslam::runtime::synth {
namespace {

constexpr double kNear = 0.1;  // metres

struct Vertex {
  Eigen::Vector3d p;   // camera frame
  Eigen::Vector2d uv;  // metres
};

/// Cuts a triangle at the near plane: a polygon of 0, 3 or 4 vertices.
int clip(const std::array<Vertex, 3>& in, std::array<Vertex, 4>& out) {
  int n = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vertex& a = in[i];
    const Vertex& b = in[(i + 1) % 3];
    const bool a_in = a.p.z() > kNear, b_in = b.p.z() > kNear;
    if (a_in) out[static_cast<std::size_t>(n++)] = a;
    if (a_in != b_in) {
      const double s = (kNear - a.p.z()) / (b.p.z() - a.p.z());
      out[static_cast<std::size_t>(n++)] = {a.p + s * (b.p - a.p), a.uv + s * (b.uv - a.uv)};
    }
  }
  return n;
}

cv::Vec3f sample(const Texture& texture, const Eigen::Vector2d& uv, double texels_per_pixel) {
  std::size_t level = 0;
  while (texels_per_pixel > 1.4 && level + 1 < texture.levels.size()) {
    texels_per_pixel *= 0.5;
    ++level;
  }
  const cv::Mat& image = texture.levels[level];
  const double scale = texture.texels_per_metre / static_cast<double>(1U << level);
  const double x = uv.x() * scale - 0.5, y = uv.y() * scale - 0.5;
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const auto a = static_cast<float>(x - x0), b = static_cast<float>(y - y0);
  // Nearly all is inside, and to divide takes long.
  const auto wrap = [](int i, int n) { return i >= 0 && i < n ? i : ((i % n) + n) % n; };
  const int xa = wrap(x0, image.cols), xb = xa + 1 < image.cols ? xa + 1 : 0;
  const int ya = wrap(y0, image.rows), yb = ya + 1 < image.rows ? ya + 1 : 0;
  const auto *upper = image.ptr<cv::Vec3b>(ya), *lower = image.ptr<cv::Vec3b>(yb);
  cv::Vec3f out;
  for (int c = 0; c < 3; ++c) {
    const auto top = (1 - a) * static_cast<float>(upper[xa][c]) + a * static_cast<float>(upper[xb][c]);
    const auto low = (1 - a) * static_cast<float>(lower[xa][c]) + a * static_cast<float>(lower[xb][c]);
    out[c] = (1 - b) * top + b * low;
  }
  return out;
}

/// Which columns of [u0, u1] a triangle reaches in row `v`, and up to one more on either side.
std::pair<int, int> columns(const std::array<Eigen::Vector2d, 3>& x, int v, int u0, int u1) {
  double low = u1, high = u0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2d &a = x[i], &b = x[(i + 1) % 3];
    if (std::min(a.y(), b.y()) > v || std::max(a.y(), b.y()) < v) continue;
    if (a.y() == b.y()) continue;  // the ends are those of the two other edges
    const double u = a.x() + (v - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    low = std::min(low, u);
    high = std::max(high, u);
  }
  return {static_cast<int>(std::max<double>(u0, std::floor(low) - 1)),
          static_cast<int>(std::min<double>(u1, std::ceil(high) + 1))};
}

/// The nearest triangle of each pixel, and where on its surface.
struct Raster {
  cv::Mat inverse_z;  // CV_64FC1
  cv::Mat id;         // CV_32SC1, -1: nothing
  cv::Mat where;      // CV_64FC2, metres
  Raster(int width, int height)
      : inverse_z(cv::Mat::zeros(height, width, CV_64FC1)),
        id(height, width, CV_32SC1, cv::Scalar(-1)),
        where(cv::Mat::zeros(height, width, CV_64FC2)) {}

  /// Fills triangle number `k`, whose corners lie before the camera.
  void fill(const std::array<Vertex, 3>& v, int k, const Pinhole<double>& camera) {
    std::array<Eigen::Vector2d, 3> x;
    for (std::size_t i = 0; i < 3; ++i) {
      x[i] = {camera.fx() * v[i].p.x() / v[i].p.z() + camera.cx(),
              camera.fy() * v[i].p.y() / v[i].p.z() + camera.cy()};
    }
    const double area = (x[1] - x[0]).x() * (x[2] - x[0]).y() - (x[1] - x[0]).y() * (x[2] - x[0]).x();
    if (std::abs(area) < 1e-9) return;
    // No pixel of it is nearer than its nearest corner, but for what is rounded.
    const double bound = (1 + 1e-12) / std::min({v[0].p.z(), v[1].p.z(), v[2].p.z()});
    const int u0 = std::max(0, static_cast<int>(std::ceil(std::min({x[0].x(), x[1].x(), x[2].x()}))));
    const int u1 =
        std::min(id.cols - 1, static_cast<int>(std::floor(std::max({x[0].x(), x[1].x(), x[2].x()}))));
    const int v0 = std::max(0, static_cast<int>(std::ceil(std::min({x[0].y(), x[1].y(), x[2].y()}))));
    const int v1 =
        std::min(id.rows - 1, static_cast<int>(std::floor(std::max({x[0].y(), x[1].y(), x[2].y()}))));
    for (int py = v0; py <= v1; ++py) {
      const auto [first, last] = columns(x, py, u0, u1);
      auto* nearest = inverse_z.ptr<double>(py);
      for (int px = first; px <= last; ++px) {
        if (nearest[px] >= bound) continue;
        const Eigen::Vector2d q(px, py);
        const auto edge = [&](std::size_t a, std::size_t b) {
          return ((x[b] - x[a]).x() * (q - x[a]).y() - (x[b] - x[a]).y() * (q - x[a]).x()) / area;
        };
        const double w0 = edge(1, 2), w1 = edge(2, 0), w2 = 1 - w0 - w1;
        if (w0 < 0 || w1 < 0 || w2 < 0) continue;
        const double i0 = w0 / v[0].p.z(), i1 = w1 / v[1].p.z(), i2 = w2 / v[2].p.z();
        const double inverse = i0 + i1 + i2;
        double& best = nearest[px];
        if (inverse <= best) continue;
        best = inverse;
        id.at<int>(py, px) = k;
        const Eigen::Vector2d uv = (i0 * v[0].uv + i1 * v[1].uv + i2 * v[2].uv) / inverse;
        where.at<cv::Vec2d>(py, px) = {uv.x(), uv.y()};
      }
    }
  }
};

Raster rasterise(std::span<const Triangle> triangles, const Pinhole<double>& camera, const SE3<double>& T_c_w,
                 int width, int height) {
  Raster raster(width, height);
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const Triangle& t = triangles[k];
    std::array<Vertex, 3> in;
    for (std::size_t i = 0; i < 3; ++i) in[i] = {T_c_w * t.p[i], t.uv[i]};
    std::array<Vertex, 4> polygon;
    const int n = clip(in, polygon);
    for (std::size_t fan = 1; fan + 1 < static_cast<std::size_t>(n); ++fan)
      raster.fill({polygon[0], polygon[fan], polygon[fan + 1]}, static_cast<int>(k), camera);
  }
  return raster;
}

}  // namespace

Rendering render(std::span<const Triangle> triangles, const std::vector<Texture>& textures,
                 const Pinhole<double>& camera, const SE3<double>& T_c_w, int width, int height) {
  Rendering r;
  r.bgr = cv::Mat::zeros(height, width, CV_8UC3);
  r.cosine = cv::Mat::zeros(height, width, CV_32FC1);
  r.depth = cv::Mat::zeros(height, width, CV_32FC1);
  r.label = cv::Mat::zeros(height, width, CV_8UC1);
  r.dynamic = cv::Mat::zeros(height, width, CV_8UC1);
  r.box = cv::Mat::zeros(height, width, CV_8UC1);
  r.instance = cv::Mat::zeros(height, width, CV_16UC1);

  // First the nearest triangle of each pixel, then its colour once.
  const Raster raster = rasterise(triangles, camera, T_c_w, width, height);
  const Eigen::Matrix3d R = T_c_w.rotation_matrix();
  const Eigen::Vector3d light = Eigen::Vector3d(0.35, -0.5, 0.8).normalized();
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const int k = raster.id.at<int>(v, u);
      if (k < 0) continue;
      const Triangle& t = triangles[static_cast<std::size_t>(k)];
      const double z = 1.0 / raster.inverse_z.at<double>(v, u);
      const Eigen::Vector3d ray = camera.ray(Eigen::Vector2d(u, v)).normalized();
      const double cosine = std::abs((R * t.normal).dot(ray));
      const Texture& texture = textures[static_cast<std::size_t>(t.texture)];
      const auto& uv = raster.where.at<cv::Vec2d>(v, u);
      const double footprint = z / camera.fx() * texture.texels_per_metre / std::max(0.3, cosine);
      const auto shade = static_cast<float>(0.62 + 0.26 * std::max(0.0, t.normal.dot(light)) +
                                            0.12 * std::max(0.0, t.normal.z()));
      const cv::Vec3f colour = sample(texture, {uv[0], uv[1]}, footprint) * shade;
      for (int c = 0; c < 3; ++c) r.bgr.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<std::uint8_t>(colour[c]);
      r.depth.at<float>(v, u) = static_cast<float>(z);
      r.cosine.at<float>(v, u) = static_cast<float>(cosine);
      r.label.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(t.label);
      r.instance.at<std::uint16_t>(v, u) = t.instance;
      r.dynamic.at<std::uint8_t>(v, u) = t.dynamic ? 255 : 0;
      r.box.at<std::uint8_t>(v, u) = t.box ? 255 : 0;
    }
  }
  return r;
}

cv::Mat sense_depth(const Rendering& exact, double fx, double scale, Random& random) {
  constexpr double kBaseline = 0.075;  // metres between projector and camera
  constexpr double kStep = 1.0 / 8.0;  // px of the sensor
  constexpr double kNoise = 0.06;      // px of the sensor
  cv::Mat raw = cv::Mat::zeros(exact.depth.size(), CV_16UC1);
  const double fb = fx * kBaseline, sensor_fb = fb / scale;
  for (int v = 0; v < raw.rows; ++v) {
    double lit = -1e9;  // how far to the right the projector's rays are used up, in its own columns
    for (int u = 0; u < raw.cols; ++u) {
      const auto z = static_cast<double>(exact.depth.at<float>(v, u));
      const double chance = random.uniform(0, 1),
                   noise = random.normal();  // drawn always: one stream per frame
      if (!(z > 0)) continue;
      const double column = u - fb / z;
      const bool shadow = column < lit - 0.75;
      lit = std::max(lit, column);
      if (shadow || z < 0.45 || z > 7.0) continue;
      const double cosine = static_cast<double>(exact.cosine.at<float>(v, u));
      const auto& c = exact.bgr.at<cv::Vec3b>(v, u);
      const double luminance = 0.114 * c[0] + 0.587 * c[1] + 0.299 * c[2];
      const double lost = 0.002 + (luminance < 28 ? 0.25 : 0.0) + (cosine < 0.2 ? 4 * (0.2 - cosine) : 0.0);
      if (chance < lost) continue;
      const double disparity = std::round((sensor_fb / z + kNoise * noise) / kStep) * kStep;
      if (disparity > 0.5)
        raw.at<std::uint16_t>(v, u) = cv::saturate_cast<std::uint16_t>(5000.0 * sensor_fb / disparity);
    }
  }
  return raw;
}

}  // namespace dynslam::runtime::synth
