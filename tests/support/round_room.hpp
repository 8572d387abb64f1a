// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/features/place_index.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/map/keyframe_map.hpp"
#include "random.hpp"

namespace dynslam::test {

/// A camera in a round room that looks outwards and turns around once, with drift; what comes into view
/// a second time is mapped a second time.
/// @tparam Camera  of 640 x 480 pixels
template <CameraModel Camera>
struct RoundRoom {
  using S = typename Camera::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static constexpr int kWidth = 640, kHeight = 480;
  static constexpr double kRadius = 3.0;
  static constexpr double kStep = 10.0;      // degrees between keyframes
  static constexpr std::size_t kMemory = 5;  // keyframes after which tracking no longer recognises a point

  Camera camera;
  DepthNoise<S> noise{S(0.005), S(0)};
  KeyframeMap<S> map;
  PlaceIndex index;
  std::vector<SE3<S>> truth;  // T_c_w
  std::vector<Vector3> points;
  std::vector<Descriptor> descriptors;
  typename SE3<S>::Vector6 drift = SE3<S>::Vector6::Zero();
  Rng rng{"round room"};

  explicit RoundRoom(const Camera& of) : camera(of) {
    drift << S(0.006), S(0.002), S(-0.004), S(0.0005), S(0.002), S(-0.0005);
    for (int j = 0; j < 4000; ++j) {
      const double a = rng.uniform(0, 2 * std::numbers::pi), z = rng.uniform(-0.6, 0.6);
      points.emplace_back(S(kRadius * std::cos(a) * std::cos(z)), S(kRadius * std::sin(z)),
                          S(kRadius * std::sin(a) * std::cos(z)));
      descriptors.emplace_back();
      for (auto& word : descriptors.back()) word = rng.engine()();
    }
  }

  /// Depth of the wall; where the camera has no ray there is none.
  [[nodiscard]] Image<float> depth(const SE3<S>& T_c_w) const { return depth(T_c_w, camera); }
  /// The same through another lens.
  template <CameraModel Other>
  [[nodiscard]] Image<float> depth(const SE3<S>& T_c_w, const Other& through) const {
    Image<float> image(kWidth, kHeight, std::nanf(""));
    const SE3<S> T_w_c = T_c_w.inverse();
    const Vector3 o = T_w_c.translation();
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const std::optional<Vector3> ray = through.unproject(Vector2(S(u), S(v)), S(1));
        if (!ray) continue;
        const Vector3 d = T_w_c.so3() * *ray;
        const S a = d.squaredNorm(), b = d.dot(o), c = o.squaredNorm() - S(kRadius * kRadius);
        image(u, v) = static_cast<float>((-b + std::sqrt(b * b - a * c)) / a);
      }
    }
    return image;
  }

  /// The next keyframe, put into the map as tracking would have it: beside its predecessor, with drift.
  int add() {
    const auto k = truth.size();
    const double a = kStep * static_cast<double>(k) * std::numbers::pi / 180;
    const SE3<S> T_w_c(SO3<S>::exp(Vector3(0, S(a), 0)),
                       Vector3(S(0.5 * std::sin(a)), 0, S(0.5 * std::cos(a))));
    truth.push_back(T_w_c.inverse());
    FeatureFrame<S> f;
    f.index = k;
    f.T_c_w = k == 0 ? truth[0]
                     : SE3<S>::exp(drift) * truth[k] * truth[k - 1].inverse() *
                           map.keyframe(static_cast<int>(k) - 1).frame.T_c_w;
    active.resize(points.size(), -1);
    seen.resize(points.size(), 0);
    for (std::size_t j = 0; j < points.size(); ++j) {
      const Vector3 p_c = truth[k] * points[j];
      const auto x = camera.project(p_c);
      if (!x || x->x() < 0 || x->y() < 0 || x->x() > kWidth - 1 || x->y() > kHeight - 1) continue;
      Feature feature;
      feature.u = feature.x = static_cast<float>(x->x() + S(0.3 * rng.normal()));
      feature.v = feature.y = static_cast<float>(x->y() + S(0.3 * rng.normal()));
      feature.sigma = 0.5F;
      feature.depth = static_cast<float>(p_c.z() + S(0.005 * rng.normal()));
      const std::optional<Vector3> measured =
          camera.unproject(Vector2(S(feature.x), S(feature.y)), S(feature.depth));
      if (!measured) continue;
      f.features.push_back(feature);
      f.descriptors.push_back(descriptors[j]);
      for (int bit = 0; bit < 12; ++bit)
        f.descriptors.back()[static_cast<std::size_t>(rng.integer(0, 3))] ^= 1ULL << rng.integer(0, 63);
      active[j] = map.present(active[j]);
      if (active[j] < 0 || k - seen[j] > kMemory) {
        MapPoint<S> p;
        p.p_w = f.T_c_w.inverse() * *measured;
        p.descriptor = f.descriptors.back();
        active[j] = map.add_point(p);
      }
      seen[j] = k;
      f.point.push_back(active[j]);
      f.dynamic.push_back(0);
    }
    f.grid.build(f.features, kWidth, kHeight);
    return map.add_keyframe(f);
  }

  /// Of the motion between two keyframes [m].
  [[nodiscard]] S error(int from, int to) const {
    const SE3<S> true_motion =
        truth[static_cast<std::size_t>(to)] * truth[static_cast<std::size_t>(from)].inverse();
    return (map.pose(to) * map.pose(from).inverse() * true_motion.inverse()).translation().norm();
  }

  /// Share of the sights whose point lies more than 8 px beside them.
  [[nodiscard]] double doubted_sights() const {
    int wrong = 0, sights = 0;
    for (const Keyframe<S>& k : map.keyframes()) {
      for (std::size_t i = 0; i < k.frame.point.size(); ++i) {
        if (k.frame.point[i] < 0) continue;
        const auto x = camera.project(k.frame.T_c_w * map.point(k.frame.point[i]).p_w);
        ++sights;
        wrong += !x || (*x - Vector2(S(k.frame.features[i].x), S(k.frame.features[i].y))).norm() > 8 ? 1 : 0;
      }
    }
    return static_cast<double>(wrong) / sights;
  }

 private:
  std::vector<int> active;
  std::vector<std::size_t> seen;
};

}  // namespace dynslam::test
