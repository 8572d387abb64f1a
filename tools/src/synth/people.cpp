// SPDX-License-Identifier: BSD-3-Clause
#include "synth/people.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace dynslam::runtime::synth {
namespace {

using Eigen::Affine3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

struct Stride {
  double x, y, heading;
};

Stride stride(const Walker& walker, double t) {
  // Back and forth along x: a triangle wave of position, with a quick turn at its ends.
  const double period = 4 * walker.range / std::abs(walker.speed);
  const double shift = std::asin(std::clamp(walker.x0 / walker.range, -1.0, 1.0)) * 2 / std::numbers::pi *
                       walker.range / std::abs(walker.speed);
  double s =
      std::fmod(t + (walker.speed > 0 ? shift : period / 2 - shift) + 10 * period, period) / period;  // 0..1
  const double triangle = s < 0.25 ? 4 * s : s < 0.75 ? 2 - 4 * s : 4 * s - 4;                        // -1..1
  const double direction = s < 0.25 || s >= 0.75 ? 1 : -1;
  const double to_turn = std::min(std::abs(s - 0.25), std::abs(s - 0.75)) * period;
  const double turn =
      std::clamp(1 - to_turn / 0.35, 0.0, 1.0) * std::numbers::pi / 2;  // faces the camera while turning
  const double x = triangle * walker.range, y = walker.y + 0.12 * std::sin(0.9 * t + walker.phase);
  const double heading = direction > 0 ? -turn : std::numbers::pi + turn;
  return {x, y, heading};
}

/// Draws one body of limbs.
class Body {
 public:
  Body(std::vector<Triangle>& out, const Affine3d& T, double scale, const Tag& tag)
      : out_(out), T_(T), scale_(scale), tag_(tag) {}
  /// From `a` to `b`, forward, left and up of where the body stands, for a body of 1.75 m.
  void add(const Vector3d& a, const Vector3d& b, double ra, double rb, int texture) const {
    limb(out_, T_ * a, T_ * b, ra * scale_, rb * scale_, texture, tag_);
  }

 private:
  std::vector<Triangle>& out_;
  Affine3d T_;
  double scale_;
  Tag tag_;
};

Vector3d shoulder_of(double side) {
  return {0.02, 0.22 * side, 1.38};
}

Leg swinging_leg(double side, double phase) {
  const double swing = 0.5 * std::sin(phase + (side > 0 ? 0 : std::numbers::pi));
  const double bend = 0.35 + 0.35 * std::max(0.0, -std::cos(phase + (side > 0 ? 0 : std::numbers::pi)));
  const double hip = 0.09 * side;
  const Vector3d knee(0.43 * std::sin(swing), hip, 0.9 - 0.43 * std::cos(swing));
  const Vector3d ankle = knee + Vector3d(0.43 * std::sin(swing - bend), 0, -0.43 * std::cos(swing - bend));
  return {Vector3d(0, hip, 0.9), knee, ankle,
          Vector3d(ankle.x() + 0.16, ankle.y(), std::max(0.04, ankle.z() - 0.03))};
}

Arm carrying_arm(double side) {
  const Vector3d shoulder = shoulder_of(side);
  const Vector3d elbow = shoulder + Vector3d(0.12, 0.02 * side, -0.26);
  return {shoulder, elbow, elbow + Vector3d(0.24, -0.05 * side, 0.02)};
}

}  // namespace

Looks make_looks(Random& r, const Textures& textures, int k, std::uint16_t instance) {
  const auto i = static_cast<std::size_t>(k % 4);
  return {r.uniform(1.62, 1.88), textures.shirts[i], textures.trousers[i],
          textures.skins[i],     textures.hairs[i],  instance};
}

Walker make_walker(Random& r, const Textures& textures, int k, std::uint16_t instance, bool carries) {
  const double direction = k % 2 == 0 ? 1 : -1;
  return {direction * r.uniform(-1.9, -1.2),
          0.75 + 0.4 * (k % 3) + r.uniform(-0.08, 0.08),
          direction * r.uniform(0.65, 1.0),
          r.uniform(0, 6),
          make_looks(r, textures, k, instance),
          r.uniform(1.7, 2.3),
          carries};
}

Arm hanging_arm(double side, double angle) {
  const Vector3d shoulder = shoulder_of(side);
  const Vector3d elbow = shoulder + Vector3d(0.28 * std::sin(angle), 0.03 * side, -0.28 * std::cos(angle));
  return {shoulder, elbow, elbow + Vector3d(0.25 * std::sin(angle + 0.4), 0, -0.25 * std::cos(angle + 0.4))};
}

void add_person(std::vector<Triangle>& out, const Textures& textures, const Looks& looks, const Affine3d& T,
                const Posture& posture) {
  const Body body(out, T, looks.height / 1.75, {Label::person, looks.instance, true});
  body.add(Vector3d(0, 0.07, 1.0), Vector3d(0.02, 0.06, 1.32), 0.145, 0.15,
           looks.shirt);  // two capsules make a broad trunk
  body.add(Vector3d(0, -0.07, 1.0), Vector3d(0.02, -0.06, 1.32), 0.145, 0.15, looks.shirt);
  body.add(Vector3d(0, 0, 0.9), Vector3d(0, 0, 0.98), 0.155, 0.16, looks.trousers);
  body.add(Vector3d(0.03, 0, 1.45), Vector3d(0.04, 0, 1.52), 0.055, 0.055, looks.skin);
  body.add(Vector3d(0.05, 0, 1.6), Vector3d(0.05, 0, 1.66), 0.095, 0.1, looks.skin);
  body.add(Vector3d(0.02, 0, 1.66), Vector3d(0.01, 0, 1.69), 0.105, 0.1, looks.hair);
  for (std::size_t i = 0; i < 2; ++i) {
    const Leg& leg = posture.legs[i];
    body.add(leg.hip, leg.knee, 0.085, 0.06, looks.trousers);
    body.add(leg.knee, leg.ankle, 0.06, 0.045, looks.trousers);
    body.add(leg.ankle, leg.toe, 0.05, 0.04, textures.dark);
    const Arm& arm = posture.arms[i];
    body.add(arm.shoulder, arm.elbow, 0.055, 0.045, looks.shirt);
    body.add(arm.elbow, arm.hand, 0.042, 0.036, looks.skin);
  }
}

void add_walker(std::vector<Triangle>& out, const Textures& textures, const Walker& walker, double t) {
  const auto [x, y, heading] = stride(walker, t);
  const double phase = t * std::abs(walker.speed) * 4.4 + walker.phase;
  const Affine3d T =
      at(x, y, 0.02 * std::sin(2 * phase), heading) * Eigen::Scaling(walker.looks.height / 1.75);
  Posture posture;
  for (std::size_t i = 0; i < 2; ++i) {
    const double side = i == 0 ? -1 : 1;
    posture.legs[i] = swinging_leg(side, phase);
    const double arm = -0.55 * std::sin(phase + (side > 0 ? 0 : std::numbers::pi));
    posture.arms[i] = walker.carries ? carrying_arm(side) : hanging_arm(side, arm);
  }
  add_person(out, textures, walker.looks, T, posture);
  if (walker.carries) {
    box(out, at(0, 0, 0) * T * Translation3d(0.44, 0, 1.12), {0.34, 0.46, 0.34}, textures.carton,
        {Label::background, 0, true, true});
  }
}

void add_sitter(std::vector<Triangle>& out, const Textures& textures, double x, double y,
                std::uint16_t instance, double t) {
  const Tag tag{Label::person, instance, false};
  const Affine3d T = at(x, y, 0, std::numbers::pi / 2);
  const double sway = 0.008 * std::sin(1.3 * t);  // nobody sits like a stone
  const auto p = [&](double forward, double left, double up) {
    return Vector3d(T * Vector3d(forward, left, up));
  };
  const int shirt = textures.shirts[2], trousers = textures.trousers[2], skin = textures.skins[2],
            hair = textures.hairs[2];
  limb(out, p(-0.08, 0.07, 0.62), p(0.0 + sway, 0.06, 0.98), 0.14, 0.145, shirt, tag);
  limb(out, p(-0.08, -0.07, 0.62), p(0.0 + sway, -0.06, 0.98), 0.14, 0.145, shirt, tag);
  limb(out, p(0.02 + sway, 0, 1.1), p(0.03 + sway, 0, 1.18), 0.055, 0.055, skin, tag);
  limb(out, p(0.05 + sway, 0, 1.25), p(0.05 + sway, 0, 1.31), 0.095, 0.1, skin, tag);
  limb(out, p(0.02 + sway, 0, 1.31), p(0.01 + sway, 0, 1.34), 0.105, 0.1, hair, tag);
  for (const double side : {-1.0, 1.0}) {
    limb(out, p(-0.05, 0.1 * side, 0.58), p(0.36, 0.11 * side, 0.56), 0.085, 0.065, trousers, tag);
    limb(out, p(0.36, 0.11 * side, 0.56), p(0.38, 0.12 * side, 0.1), 0.06, 0.045, trousers, tag);
    limb(out, p(0.38, 0.12 * side, 0.06), p(0.52, 0.13 * side, 0.05), 0.05, 0.04, textures.dark, tag);
    limb(out, p(0.0 + sway, 0.21 * side, 1.02), p(0.12, 0.24 * side, 0.78), 0.055, 0.045, shirt, tag);
    limb(out, p(0.12, 0.24 * side, 0.78), p(0.38, 0.14 * side, 0.78), 0.042, 0.036, skin, tag);
  }
}

}  // namespace dynslam::runtime::synth
