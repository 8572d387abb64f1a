// SPDX-License-Identifier: BSD-3-Clause
// Cameras to try what promises to take any.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/pinhole.hpp"

namespace dynslam::test {

/// A panorama: longitude and latitude in pixels, u = f atan2(x, z) + cx, v = f atan2(y, |(x, z)|) + cy. It
/// has no focal plane and sees behind itself.
template <Scalar S>
class Panorama {
 public:
  using ScalarType = S;

  Panorama(S f, S cx, S cy) : f_(f), cx_(cx), cy_(cy) {}

  [[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> project(const Eigen::Matrix<S, 3, 1>& p) const {
    return project(p, nullptr);
  }
  [[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> project(const Eigen::Matrix<S, 3, 1>& p,
                                                              Eigen::Matrix<S, 2, 3>* J) const {
    using std::atan2;
    using std::sqrt;
    const S x = p.x(), y = p.y(), z = p.z();
    const S h2 = x * x + z * z, r2 = h2 + y * y;
    if (!(S(1e-9) < h2)) return std::nullopt;  // straight up or down: no longitude
    const S h = sqrt(h2);
    if (J != nullptr)
      *J << f_ * z / h2, S(0), -f_ * x / h2, -f_ * x * y / (h * r2), f_ * h / r2, -f_ * z * y / (h * r2);
    return Eigen::Matrix<S, 2, 1>(f_ * atan2(x, z) + cx_, f_ * atan2(y, h) + cy_);
  }
  [[nodiscard]] std::optional<Eigen::Matrix<S, 3, 1>> unproject(const Eigen::Matrix<S, 2, 1>& x,
                                                                const S& z) const {
    using std::cos;
    using std::tan;
    const S longitude = (x.x() - cx_) / f_, latitude = (x.y() - cy_) / f_;
    if (!(S(0.01) < cos(longitude) && S(0.01) < cos(latitude))) return std::nullopt;
    return Eigen::Matrix<S, 3, 1>(tan(longitude) * z, tan(latitude) / cos(longitude) * z, z);
  }
  template <Scalar T>
  [[nodiscard]] Panorama<T> cast() const {
    return Panorama<T>(T(f_), T(cx_), T(cy_));
  }

 private:
  S f_, cx_, cy_;
};

static_assert(DifferentiableCamera<Panorama<float>> && DifferentiableCamera<Panorama<double>>);

/// The panorama without a derivative: a CameraModel that is not differentiable.
template <Scalar S>
class PlainPanorama {
 public:
  using ScalarType = S;

  explicit PlainPanorama(const Panorama<S>& camera) : camera_(camera) {}
  [[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> project(const Eigen::Matrix<S, 3, 1>& p) const {
    return camera_.project(p);
  }
  [[nodiscard]] std::optional<Eigen::Matrix<S, 3, 1>> unproject(const Eigen::Matrix<S, 2, 1>& x,
                                                                const S& z) const {
    return camera_.unproject(x, z);
  }

 private:
  Panorama<S> camera_;
};

static_assert(CameraModel<PlainPanorama<double>> && !DifferentiableCamera<PlainPanorama<double>>);

/// A pinhole that does not say so: the same camera by the path for all others.
template <Scalar S>
class DisguisedPinhole {
 public:
  using ScalarType = S;

  explicit DisguisedPinhole(const Pinhole<S>& camera) : camera_(camera) {}
  [[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> project(const Eigen::Matrix<S, 3, 1>& p) const {
    return camera_.project(p);
  }
  [[nodiscard]] std::optional<Eigen::Matrix<S, 2, 1>> project(const Eigen::Matrix<S, 3, 1>& p,
                                                              Eigen::Matrix<S, 2, 3>* J) const {
    return camera_.project(p, J);
  }
  [[nodiscard]] std::optional<Eigen::Matrix<S, 3, 1>> unproject(const Eigen::Matrix<S, 2, 1>& x,
                                                                const S& z) const {
    return camera_.unproject(x, z);
  }

 private:
  Pinhole<S> camera_;
};

static_assert(DifferentiableCamera<DisguisedPinhole<float>> &&
              DifferentiableCamera<DisguisedPinhole<double>>);

}  // namespace dynslam::test
