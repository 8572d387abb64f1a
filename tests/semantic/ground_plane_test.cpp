// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/ground_plane.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "dynslam/semantic/voxel_block_map.hpp"
#include "painted_map.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A floor of 3 x 3 m, a wall of 3 x 2 m, a table of 1 x 1 m at 0.7 m, and noise; z up from the floor.
struct GroundScene {
  bool floor = true, table = true;
  [[nodiscard]] bool occupied(const Eigen::Vector3d& p) const {
    const bool within = std::abs(p.x()) < 1.5 && std::abs(p.y()) < 1.5;
    return within && ((floor && std::abs(p.z()) < 0.04) || (p.x() > 1.42 && p.z() > 0 && p.z() < 2) ||
                      (table && p.head<2>().cwiseAbs().maxCoeff() < 0.5 && std::abs(p.z() - 0.7) < 0.04));
  }
};

VoxelBlockMap<float> map_of(const GroundScene& scene, const SE3<double>& T_ground_map) {
  test::Rng rng("noise about a floor");
  VoxelBlockMap<float> map{VoxelGrid(0.05)};
  test::paint_map(map, {-3, -3, -3}, {3, 3, 3}, [&](const Eigen::Vector3d& p) {
    const bool noise = rng.uniform() < 0.0002;
    return test::Paint{scene.occupied(T_ground_map * p) || noise ? Occupancy::occupied : Occupancy::free};
  });
  return map;
}

}  // namespace

TEST_CASE("the floor is found, not the table and not the wall, from a camera that looks down at it") {
  for (const double pitch : {0.0, 0.35, 0.7}) {
    CAPTURE(pitch);
    // z up, x ahead from a camera at 1.3 m that is pitched, and rolled by 5 degrees.
    const SE3<double> level = *ground_frame(-Eigen::Vector3d::UnitY(), 1.3);
    const SE3<double> T =
        level * SE3<double>(SO3<double>::exp(Eigen::Vector3d(-pitch, 0, 0.09)), Eigen::Vector3d(0, 0, -1.2));
    const auto found = fit_ground_plane(map_of({}, T));
    REQUIRE(found.has_value());
    const Eigen::Vector3d up = T.rotation_matrix().row(2);
    CHECK(found->up.dot(up) > std::cos(0.015));
    CHECK(found->origin_height == doctest::Approx(1.3).epsilon(0.02));
    CHECK(found->share > 0.3);
    CHECK(found->height(T.inverse() * Eigen::Vector3d(1, 1, 0.5)) == doctest::Approx(0.5).epsilon(0.06));
  }
}

TEST_CASE("without a floor none is found") {
  const SE3<double> T = *ground_frame(-Eigen::Vector3d::UnitY(), 1.3);
  CHECK_FALSE(fit_ground_plane(map_of({.floor = false, .table = false}, T)).has_value());
  CHECK_FALSE(fit_ground_plane(VoxelBlockMap<float>{VoxelGrid(0.05)}).has_value());
  GroundPlaneOptions options;
  options.up.setZero();
  CHECK_FALSE(fit_ground_plane(map_of({}, T), options).has_value());
  options.up = Eigen::Vector3d::UnitY();  // upside down: everything is below the floor
  CHECK_FALSE(fit_ground_plane(map_of({}, T), options).has_value());
}

TEST_CASE("the frame on the ground is that of ROS: x ahead, y left, z up") {
  const SE3<double> T = *ground_frame(-Eigen::Vector3d::UnitY(), 1.2);
  // 1 m to the right of the camera, 0.2 m below it and 2 m ahead.
  CHECK((T * Eigen::Vector3d(1, 0.2, 2) - Eigen::Vector3d(2, -1, 1)).norm() < 1e-12);
  const Eigen::Vector3d up(0.1, -2, -1);
  const SE3<double> tilted = *ground_frame(up, 0.4);
  CHECK((tilted.rotation_matrix() * up.normalized() - Eigen::Vector3d::UnitZ()).norm() < 1e-12);
  CHECK(tilted.rotation_matrix().determinant() == doctest::Approx(1));
  CHECK((tilted * Eigen::Vector3d(0, 0, 1)).y() == doctest::Approx(0));
  CHECK((tilted * Eigen::Vector3d(0, 0, 1)).x() > 0);
  const SE3<double> down = *ground_frame(-Eigen::Vector3d::UnitZ(), 2);  // a camera that looks at the floor
  CHECK((down * Eigen::Vector3d(0, -1, 2) - Eigen::Vector3d(1, 0, 0)).norm() < 1e-12);
  CHECK_FALSE(ground_frame(Eigen::Vector3d::Zero(), 1).has_value());
  CHECK_FALSE(ground_frame(up, std::numeric_limits<double>::quiet_NaN()).has_value());
}
