// SPDX-License-Identifier: BSD-3-Clause
#include "synth/crowd.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>

#include "synth/furniture.hpp"

namespace dynslam::runtime::synth {
namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;

constexpr double kWalkersY = 1.3, kPusherY = 0.7;  // m
constexpr double kToChair = 0.58;                  // from the pusher to the middle of the chair [m]
constexpr double kSole = 0.05;                     // height of the ankle over the sole [m]
constexpr double kHip = 0.9, kThigh = 0.43;        // m, as is the shin
constexpr double kUpperArm = 0.28, kForearm = 0.25, kHand = 0.036;

/// A passer at an instant.
struct Instant {
  double x, heading, grip, chair_x;
  double steps;      ///< done since the first stop, forwards
  double swing;      ///< 0 standing to 1 walking
  bool chair_moves;  ///< now
};

double ease(double s) {
  return s * s * (3 - 2 * s);
}

Instant instant_of(const Passer& passer, double t) {
  const std::vector<Stop>& round = passer.round;
  const double now =
      std::fmod(t + passer.start + round.back().t, round.back().t);  // a shutter opens before 0
  std::size_t i = 0;
  while (i + 2 < round.size() && round[i + 1].t <= now) ++i;
  const Stop &a = round[i], &b = round[i + 1];
  const double s = std::clamp((now - a.t) / (b.t - a.t), 0.0, 1.0), w = ease(s);
  const double x = std::lerp(a.x, b.x, w);
  return {x,
          std::lerp(a.heading, b.heading, w),
          std::lerp(a.grip, b.grip, w),
          std::lerp(a.chair_x, b.chair_x, w),
          std::cos(a.heading) * (x - round.front().x) / passer.step,
          a.x == b.x ? 0.0 : std::min(1.0, 8 * s * (1 - s)),
          a.chair_x != b.chair_x};
}

/// The joint between two bones from `a` to `c`, bent towards `pole`; `c` comes nearer where it is too far.
Vector3d bend(const Vector3d& a, Vector3d& c, double upper, double lower, const Vector3d& pole) {
  const double far = (c - a).norm();
  const Vector3d axis = (c - a) / far;
  const double d = std::min(far, 0.999 * (upper + lower));
  c = a + d * axis;
  const double along = (upper * upper - lower * lower + d * d) / (2 * d);
  const double out = std::sqrt(std::max(0.0, upper * upper - along * along));
  return a + along * axis + out * (pole - pole.dot(axis) * axis).normalized();
}

/// A foot before the hip and over the floor [m].
struct Foot {
  double ahead, lift;
};

/// A foot stays where it is while the body makes one step, and makes two while the body makes the next.
Foot foot_of(double steps, double side, double step, double swing) {
  const double half = (steps + 0.5) / 2 + (side > 0 ? 0.5 : 0.0);
  const double cycle = half - std::floor(half);
  if (cycle < 0.5) return {step * (0.5 - 2 * cycle), 0};
  const double s = 2 * cycle - 1;
  return {step * (s - 0.5), 0.08 * std::sin(std::numbers::pi * s) * swing};
}

/// @param drop  how much lower the hip is than that of a person who stands [m]
Leg standing_leg(const Foot& foot, double side, double drop) {
  const Vector3d hip(0, 0.09 * side, kHip);
  Vector3d ankle(foot.ahead, hip.y(), kSole + foot.lift + drop);
  const Vector3d knee = bend(hip, ankle, kThigh, kThigh, Vector3d::UnitX());
  return {hip, knee, ankle, ankle + Vector3d(0.16, 0, -0.01)};
}

/// @param share  0: the hand hangs, 1: it is at `target`
void reach(Arm& arm, double side, const Vector3d& target, double share) {
  arm.hand += share * (target - arm.hand);
  arm.elbow = bend(arm.shoulder, arm.hand, kUpperArm, kForearm, Vector3d(-1, 0.3 * side, -0.3).normalized());
}

/// What a hand touches.
struct Touch {
  Vector3d world;
  double share;  ///< 0: not yet, 1: the hand is there
};

/// What the hand of a side (-1 right, 1 left) touches.
using TouchOf = std::function<Touch(double side)>;

void add_passer(std::vector<Triangle>& out, const Textures& textures, const Passer& passer,
                const Instant& now, const TouchOf& touch_of) {
  const double scale = passer.looks.height / 1.75, step = passer.step / scale;
  std::array<Foot, 2> feet;
  double drop = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    feet[i] = foot_of(now.steps, i == 0 ? -1 : 1, step, now.swing);
    const double leg = 0.997 * 2 * kThigh;
    drop = std::max(drop, kHip - kSole - std::sqrt(leg * leg - feet[i].ahead * feet[i].ahead));
  }
  const Affine3d T = at(now.x, passer.y, -drop * scale, now.heading) * Eigen::Scaling(scale);
  const Affine3d T_inverse = T.inverse();
  Posture posture;
  for (std::size_t i = 0; i < 2; ++i) {
    const double side = i == 0 ? -1 : 1;
    posture.legs[i] = standing_leg(feet[i], side, drop);
    Arm& arm = posture.arms[i] = hanging_arm(side, 0.9 * feet[1 - i].ahead * now.swing);
    const Touch touch = touch_of(side);
    reach(arm, side, T_inverse * touch.world, touch.share);
  }
  add_person(out, textures, passer.looks, T, posture);
}

/// There and back, facing the camera in the turns.
std::vector<Stop> to_and_fro(double from, double to) {
  const double walk = std::abs(to - from) / 0.75, turn = 0.9, back = -std::numbers::pi;
  return {{0, from, 0, 0, 0},
          {walk, to, 0, 0, 0},
          {walk + turn, to, back, 0, 0},
          {2 * walk + turn, from, back, 0, 0},
          {2 * walk + 2 * turn, from, 0, 0, 0}};
}

/// Takes the chair, pushes it to the right, steps back, takes it again, pulls it back.
std::vector<Stop> push_and_pull() {
  const double left = -0.98, right = 0.62, aside = 0.4;
  const double a = left + kToChair, b = right + kToChair;
  return {{0.0, left - aside, 0, 0, a},  {0.4, left - aside, 0, 0, a},  {1.0, left, 0, 0, a},
          {1.2, left, 0, 1, a},          {3.2, right, 0, 1, b},         {3.4, right, 0, 0, b},
          {4.0, right - aside, 0, 0, b}, {5.0, right - aside, 0, 0, b}, {5.6, right, 0, 0, b},
          {5.8, right, 0, 1, b},         {7.8, left, 0, 1, a},          {8.0, left, 0, 0, a},
          {8.6, left - aside, 0, 0, a},  {9.0, left - aside, 0, 0, a}};
}

/// The nearer hand slides along the edge of the counter.
Touch counter_touch(const Eigen::AlignedBox3d& counter, const Passer& passer, const Instant& now,
                    double side) {
  const double ahead = now.x + 0.08 * std::cos(now.heading);
  const double beside =
      std::max(counter.min().x() - ahead, ahead - counter.max().x());  // < 0: at the counter
  const bool nearer = side * std::cos(now.heading) > 0;
  const double hand = kHand * passer.looks.height / 1.75;
  return {Vector3d(std::clamp(ahead, counter.min().x(), counter.max().x()), counter.min().y() + 0.05,
                   counter.max().z() + hand),
          nearer ? ease(std::clamp(1 - beside / 0.25, 0.0, 1.0)) : 0.0};
}

/// Wheels under the five feet of an office chair.
void add_wheels(std::vector<Triangle>& out, const Textures& textures, const Affine3d& T, const Tag& tag) {
  for (int k = 0; k < 5; ++k) {
    const double a = 2 * std::numbers::pi * k / 5;
    const Vector3d wheel(0.28 * std::cos(a), 0.28 * std::sin(a), 0.03), axle(0.01, 0, 0);
    limb(out, T * (wheel - axle), T * (wheel + axle), 0.03, 0.03, textures.dark, tag);
  }
}

}  // namespace

Crowd::Crowd(Random& random, const Textures& textures, const Eigen::AlignedBox3d& counter, int walkers,
             std::uint16_t& instances)
    : counter_(counter) {
  constexpr double kReach = 3.6;  // m, of all walkers together
  const double apart = std::min(1.2, kReach / (walkers + 1)), way = kReach - apart * (walkers - 1);
  const double step = way / std::max(1.0, std::round(way / 0.5));
  const double start = random.uniform(0, 1);
  for (int k = 0; k < walkers; ++k) {
    const Looks looks = make_looks(random, textures, k, ++instances);
    const double from = -kReach / 2 + apart * (walkers - 1 - k);
    walkers_.push_back(
        {looks, kWalkersY, step, start + random.uniform(0, 0.15), to_and_fro(from, from + way)});
  }
  pusher_ = {make_looks(random, textures, walkers, ++instances), kPusherY, 0.4, 0, push_and_pull()};
  chair_ = ++instances;
}

void Crowd::add(std::vector<Triangle>& out, const Textures& textures, double t) const {
  for (const Passer& walker : walkers_) {
    const Instant now = instant_of(walker, t);
    add_passer(out, textures, walker, now,
               [&](double side) { return counter_touch(counter_, walker, now, side); });
  }
  const Instant now = instant_of(pusher_, t);
  const Vector3d handle(now.chair_x - 0.25, pusher_.y, 1.008 + kHand);  // the top of the chair's back
  add_passer(out, textures, pusher_, now, [&](double side) {
    return Touch{handle + 0.14 * side * Vector3d::UnitY(), now.grip};
  });
  const Affine3d T = at(now.chair_x, pusher_.y, 0, -std::numbers::pi / 2);  // its back towards the pusher
  const Tag tag{Label::chair, chair_, now.chair_moves};
  add_chair(out, textures, T, tag);
  add_wheels(out, textures, T, tag);
}

}  // namespace dynslam::runtime::synth
