// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <optional>
#include <variant>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"

namespace dynslam {

/// A camera whose lens is chosen while the program runs: none, Brown and Conrady's with five or eight
/// coefficients, or Kannala and Brandt's. Its results are those of the camera that it was made of.
///
/// pinhole() is the ideal camera with the same focal lengths and centre, in whose pixels lenses are undone.
/// Each call asks once which lens it is; what looks at every pixel of every image keeps a table instead, as
/// FeaturePlacer, DepthGrid and MapScanner do.
template <Scalar S>
class AnyCamera {
 public:
  using ScalarType = S;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Jacobian = Eigen::Matrix<S, 2, 3>;

  AnyCamera() = default;
  AnyCamera(const Pinhole<S>& camera) : pinhole_(camera), lens_(PinholeBrownConrady<S>(camera)) {}
  AnyCamera(const PinholeBrownConrady<S>& camera) : pinhole_(camera.pinhole()), lens_(camera) {}
  AnyCamera(const KannalaBrandt<S>& camera)
      : pinhole_(camera.fx(), camera.fy(), camera.cx(), camera.cy()), lens_(camera) {}

  [[nodiscard]] const Pinhole<S>& pinhole() const { return pinhole_; }
  /// The lens where it is Brown and Conrady's, which no distortion is, too; else null.
  [[nodiscard]] const BrownConrady<S>* brown_conrady() const {
    const auto* camera = std::get_if<PinholeBrownConrady<S>>(&lens_);
    return camera != nullptr ? &camera->distortion() : nullptr;
  }
  /// The camera where it is Kannala and Brandt's; else null.
  [[nodiscard]] const KannalaBrandt<S>* kannala_brandt() const {
    return std::get_if<KannalaBrandt<S>>(&lens_);
  }
  /// Whether recorded pixels are those of the pinhole.
  [[nodiscard]] bool is_ideal() const { return brown_conrady() != nullptr && brown_conrady()->is_identity(); }

  /// Recorded pixel of a camera-frame point; nullopt where the camera does not see it.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  /// The same with the derivative d x / d p (2 x 3) where `J` is given.
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Jacobian* J) const {
    return of_lens([&](const auto& camera) { return camera.project(p, J); });
  }
  /// Camera-frame point of a recorded pixel at depth z [m]; nullopt outside the lens' field.
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    return of_lens([&](const auto& camera) { return camera.unproject(x, z); });
  }

  /// Pixel of pinhole() to recorded pixel; nullopt outside the lens' field.
  [[nodiscard]] std::optional<Vector2> distort_pixel(const Vector2& ideal) const {
    if (const auto* camera = kannala_brandt()) return camera->project(pinhole_.ray(ideal));
    return std::get<PinholeBrownConrady<S>>(lens_).distort_pixel(ideal);
  }
  /// Recorded pixel to pixel of pinhole(); nullopt outside the lens' field.
  [[nodiscard]] std::optional<Vector2> undistort_pixel(const Vector2& x) const {
    const auto* camera = kannala_brandt();
    if (camera == nullptr) return std::get<PinholeBrownConrady<S>>(lens_).undistort_pixel(x);
    const auto p = camera->unproject(x, S(1));
    return p ? pinhole_.project(*p) : std::nullopt;
  }

  template <Scalar T>
  [[nodiscard]] AnyCamera<T> cast() const {
    return of_lens([](const auto& camera) { return AnyCamera<T>(camera.template cast<T>()); });
  }

 private:
  template <class F>
  [[nodiscard]] auto of_lens(F&& f) const {
    if (const auto* camera = kannala_brandt()) return f(*camera);
    return f(std::get<PinholeBrownConrady<S>>(lens_));
  }

  Pinhole<S> pinhole_;
  std::variant<PinholeBrownConrady<S>, KannalaBrandt<S>> lens_;
};

static_assert(DifferentiableCamera<AnyCamera<float>> && DifferentiableCamera<AnyCamera<double>>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
