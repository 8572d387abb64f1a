// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/moves_as_one.hpp"

#include <doctest/doctest.h>

#include <random>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/image.hpp"
#include "equidistant_camera.hpp"

using namespace dynslam;

namespace {

/// Matches of a textured board 1 m away, which `body` moves in the camera's frame while the camera stands,
/// and where they are measured.
template <class Camera>
struct Board {
  using S = typename Camera::ScalarType;
  Camera camera;
  Image<float> depth{320, 240, 0.0F};
  std::vector<KeypointMatch<S>> matches;
  LocateWorkspace<S> workspace;

  /// @param scatter  shift of each match by itself [px]
  Board(const Camera& c, const SE3<S>& body, int count, double scatter) : camera(c) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> within(-0.3, 0.3), shift(-1, 1);
    while (static_cast<int>(matches.size()) < count) {
      const Eigen::Matrix<S, 3, 1> p(S(within(random)), S(within(random)), S(1)), q = body * p;
      const auto x = camera.project(p), y = camera.project(q);
      REQUIRE((x && y));
      const Eigen::Matrix<S, 2, 1> found =
          *y + Eigen::Matrix<S, 2, 1>(S(scatter * shift(random)), S(scatter * shift(random)));
      const auto u = static_cast<int>(std::lround(found.x())), v = static_cast<int>(std::lround(found.y()));
      if (u < 0 || v < 0 || u >= depth.width() || v >= depth.height()) continue;
      depth(u, v) = static_cast<float>(q.z());
      matches.push_back({*x, p, found});
    }
  }
  [[nodiscard]] bool moves(double share = 0.8) {
    return moves_as_one(camera, std::span<const KeypointMatch<S>>(matches), SE3<S>(), depth, SE3<S>(),
                        S(share), LocateOptions<S>{}, workspace);
  }
};

template <class S>
SE3<S> slid(double metres, double turned) {
  return SE3<S>(SO3<S>::exp(Eigen::Matrix<S, 3, 1>(S(0), S(0), S(turned))),
                Eigen::Matrix<S, 3, 1>(S(metres), S(0), S(0)));
}

}  // namespace

TEST_CASE_TEMPLATE("a board that slides in its own plane moves as one, through any lens", S, float, double) {
  const Pinhole<S> pinhole{S(260), S(260), S(160), S(120)};
  const test::EquidistantCamera<S> fisheye(S(220), S(160), S(120));
  CHECK(Board(pinhole, slid<S>(0.05, 0.02), 40, 0.5).moves());
  CHECK(Board(fisheye, slid<S>(0.05, 0.02), 40, 0.5).moves());
}

TEST_CASE("what stands with the room does not move, though each of its matches may be called so") {
  const Pinhole<double> camera{260, 260, 160, 120};
  CHECK_FALSE(Board(camera, SE3<double>(), 40, 0.5).moves());
}

TEST_CASE("matches that each go their own way are no body") {
  const Pinhole<double> camera{260, 260, 160, 120};
  CHECK_FALSE(Board(camera, slid<double>(0.05, 0), 40, 15).moves());
}

TEST_CASE("a share of wrong matches is borne, and no more than that") {
  const Pinhole<double> camera{260, 260, 160, 120};
  Board board(camera, slid<double>(0.05, 0.02), 40, 0.3);
  for (std::size_t k = 0; k < board.matches.size(); k += 4) board.matches[k].x_m.y() += k % 8 == 0 ? 14 : -17;
  CHECK(board.moves(0.7));
  CHECK_FALSE(board.moves(0.8));
}

TEST_CASE("fewer than three matches say nothing") {
  const Pinhole<double> camera{260, 260, 160, 120};
  CHECK_FALSE(Board(camera, slid<double>(0.05, 0), 2, 0).moves());
}
