// SPDX-License-Identifier: BSD-3-Clause
// Labels carried from view to view, against a scene whose labels are known everywhere.
#include "dynslam/semantic/carried_labels.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "equidistant_camera.hpp"
#include "moved_camera.hpp"

using namespace dynslam;

namespace {

constexpr int kLabelsWidth = 120, kLabelsHeight = 90;

/// A wall at 2.5 m with a display on it, and before it the card of a chair at 1.2 m.
struct LabelledScene {
  double card_x = 0;  ///< of the card's middle [m]

  struct View {
    Image<float> depth{kLabelsWidth, kLabelsHeight, std::numeric_limits<float>::quiet_NaN()};
    Image<std::uint16_t> labels{kLabelsWidth, kLabelsHeight, 0};
  };

  template <class Camera>
  [[nodiscard]] View seen_by(const Camera& camera, const SE3d& T_w_c) const {
    using S = typename Camera::ScalarType;
    View view;
    for (int v = 0; v < kLabelsHeight; ++v) {
      for (int u = 0; u < kLabelsWidth; ++u) {
        const auto ray = camera.unproject(Eigen::Matrix<S, 2, 1>(S(u), S(v)), S(1));
        if (!ray) continue;
        const Eigen::Vector3d d = T_w_c.so3() * ray->template cast<double>(), c = T_w_c.translation();
        const auto meet = [&](double z) { return (z - c.z()) / d.z(); };  // = depth, as ray.z = 1
        const Eigen::Vector3d on_card = c + meet(1.2) * d, on_wall = c + meet(2.5) * d;
        const bool card = std::abs(on_card.x() - card_x) < 0.25 && std::abs(on_card.y()) < 0.3;
        view.depth(u, v) = static_cast<float>(meet(card ? 1.2 : 2.5));
        const bool display = std::abs(on_wall.x() - 0.6) < 0.4 && std::abs(on_wall.y() + 0.2) < 0.3;
        view.labels(u, v) = card ? 700 : display ? 3 : 0;
      }
    }
    return view;
  }
};

/// Whether all labels within two pixels are the same.
bool inside(const Image<std::uint16_t>& labels, int u, int v) {
  for (int y = v - 2; y <= v + 2; ++y) {
    for (int x = u - 2; x <= u + 2; ++x) {
      if (!labels.contains(x, y) || labels(x, y) != labels(u, v)) return false;
    }
  }
  return true;
}

struct Carried {
  Image<std::uint16_t> labels{kLabelsWidth, kLabelsHeight, 9};
  int right = 0, missed = 0, wrong = 0;  // of the pixels inside labels
};

template <class Camera>
Carried carry(const Camera& camera, const LabelledScene& then, const LabelledScene& now,
              const SE3d& T_w_now) {
  using S = typename Camera::ScalarType;
  const auto a = then.seen_by(camera, SE3d()), b = now.seen_by(camera, T_w_now);
  Carried out;
  carry_labels(camera, a.depth, a.labels, b.depth, T_w_now.cast<S>(), out.labels);
  for (int v = 0; v < kLabelsHeight; ++v) {
    for (int u = 0; u < kLabelsWidth; ++u) {
      if (!inside(b.labels, u, v)) continue;
      const int want = b.labels(u, v), got = out.labels(u, v);
      if (want == 0 && got == 0) continue;
      ++(got == want ? out.right : got == 0 ? out.missed : out.wrong);
    }
  }
  return out;
}

template <class Camera>
void check_camera(const Camera& camera) {
  const LabelledScene scene;
  const Carried same = carry(camera, scene, scene, SE3d());
  CHECK(same.right > 500);
  CHECK(same.missed == 0);
  CHECK(same.wrong == 0);
  const Carried moved = carry(camera, scene, scene, test::moved(0.15, -0.05, 0.1, 0.08));
  CHECK(moved.right > 500);
  CHECK(moved.wrong == 0);
  // What the card hid of the display, and what was out of sight.
  CHECK(moved.missed < moved.right / 4);
}

}  // namespace

TEST_CASE("labels are carried to the pixels that show the same surface, with any camera") {
  check_camera(Pinhole<double>(80, 80, 60, 45));
  check_camera(Pinhole<float>(80, 80, 60, 45));
  check_camera(test::EquidistantCamera<double>(70, 60, 45));
  const BrownConrady<float> lens(-0.2F, 0.03F, 0, 0, 0);
  check_camera(PinholeBrownConrady<float>(Pinhole<float>(80, 80, 60, 45), lens));
}

TEST_CASE("what moved since takes no label along, and leaves none on what it uncovers") {
  const Pinhole<double> camera(80, 80, 60, 45);
  LabelledScene then, now;
  then.card_x = -0.5;
  now.card_x = 0.1;
  const Carried moved = carry(camera, then, now, SE3d());
  CHECK(moved.wrong == 0);
  const auto view = now.seen_by(camera, SE3d());
  int card = 0;
  for (int v = 0; v < kLabelsHeight; ++v) {
    for (int u = 0; u < kLabelsWidth; ++u) {
      if (view.labels(u, v) != 700) continue;
      ++card;
      CHECK(moved.labels(u, v) == 0);
    }
  }
  CHECK(card > 500);
}

TEST_CASE("a label that the new image cannot hold is none, not another one") {
  const Pinhole<double> camera(80, 80, 60, 45);
  const auto view = LabelledScene().seen_by(camera, SE3d());
  Image<std::uint8_t> bytes(kLabelsWidth, kLabelsHeight, 9);
  carry_labels(camera, view.depth, view.labels, view.depth, SE3d(), bytes);
  int held = 0;
  for (int v = 0; v < kLabelsHeight; ++v) {
    for (int u = 0; u < kLabelsWidth; ++u) {
      CHECK(bytes(u, v) == (view.labels(u, v) == 700 ? 0 : view.labels(u, v)));  // 700 was 188
      held += bytes(u, v) == 3 ? 1 : 0;
    }
  }
  CHECK(held > 50);
}

TEST_CASE("pixels without depth, and views that share nothing, get no label") {
  const Pinhole<double> camera(80, 80, 60, 45);
  const LabelledScene scene;
  const auto then = scene.seen_by(camera, SE3d());
  auto now = then;
  now.depth.fill(std::numeric_limits<float>::quiet_NaN());
  Image<std::uint16_t> out(kLabelsWidth, kLabelsHeight, 9);
  carry_labels(camera, then.depth, then.labels, now.depth, SE3d(), out);
  for (int v = 0; v < kLabelsHeight; ++v)
    for (int u = 0; u < kLabelsWidth; ++u) CHECK(out(u, v) == 0);
  out.fill(9);
  const SE3d behind(SO3d::exp(Eigen::Vector3d(0, 3.1, 0)), Eigen::Vector3d::Zero());
  carry_labels(camera, then.depth, then.labels, then.depth, behind, out);
  for (int v = 0; v < kLabelsHeight; ++v)
    for (int u = 0; u < kLabelsWidth; ++u) CHECK(out(u, v) == 0);
}
