// SPDX-License-Identifier: BSD-3-Clause
// Places seen again, with every camera.
#include <doctest/doctest.h>

#include "cameras.hpp"
#include "dynslam/features/place_index.hpp"
#include "dynslam/map/loop_closer.hpp"
#include "dynslam/map/place_verifier.hpp"
#include "round_room.hpp"

using namespace dynslam;

namespace {

/// The same lens with the pixels of an image four times as large, that of RoundRoom.
template <class Camera>
class Enlarged {
 public:
  using ScalarType = typename Camera::ScalarType;
  using S = ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static constexpr int kScale = 4;

  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Eigen::Matrix<S, 2, 3>* J) const {
    auto x = camera_.project(p, J);
    if (x) *x *= S(kScale);
    if (J != nullptr) *J *= S(kScale);
    return x;
  }
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    return camera_.unproject(x / S(kScale), z);
  }

 private:
  Camera camera_ = test::conformance_camera<Camera>();
};

}  // namespace

TEST_CASE_TEMPLATE("a loop closes with every camera", Camera, DYNSLAM_CONFORMANCE_EACH_CAMERA) {
  using S = typename Camera::ScalarType;
  using Large = Enlarged<Camera>;
  test::RoundRoom<Large> room{Large()};
  room.points.resize(1500);
  PlaceVerifier<Large, Large> verifier(room.camera, room.camera, room.noise);
  LoopCloser<Large> closer(room.camera, room.camera, room.noise);
  for (int k = 0; k < 36; ++k) {
    const int id = room.add();
    room.index.add(id, room.map.keyframe(id).frame);
  }
  const int last = room.add();
  const S drifted = room.error(0, last);
  const Image<float> depth = room.depth(room.truth.back());
  CHECK(verifier.verify(room.map, room.map.keyframe(last).frame, depth, 0).ok());
  const auto closing = closer.close(room.map, room.index, last, depth);
  REQUIRE(closing);
  CHECK(room.error(closing->seen_again, last) < S(0.3) * drifted);
}
