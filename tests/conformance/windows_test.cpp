// SPDX-License-Identifier: BSD-3-Clause
// Windows and two views.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/detail/wide_vectors.hpp"
#include "dynslam/dynamics/residual_batch.hpp"
#include "dynslam/geometry/detail/best_model.hpp"
#include "dynslam/geometry/detail/epipolar_null_space.hpp"
#include "dynslam/geometry/detail/epipolar_step.hpp"
#include "dynslam/geometry/detail/normalised_matches.hpp"
#include "dynslam/geometry/detail/plane_of_inliers.hpp"
#include "dynslam/geometry/detail/polynomial_roots.hpp"
#include "dynslam/geometry/detail/ray_search.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/epipolar_rows.hpp"
#include "dynslam/geometry/essential.hpp"
#include "dynslam/geometry/five_point.hpp"
#include "dynslam/geometry/fundamental_search.hpp"
#include "dynslam/geometry/hartley.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/ray_consensus.hpp"
#include "dynslam/geometry/ray_matches.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/two_view.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/robust/kernels.hpp"
#include "scene.hpp"

using namespace dynslam;
using test::points;
using test::pose_of;
using test::put_pose;

namespace {

template <class Camera>
void windows(test::Record<double>& out) {
  using S = typename Camera::ScalarType;
  const auto camera = test::conformance_camera<Camera>();
  std::vector<SE3<S>> poses;
  for (const double a : {0.0, 0.5, 1.0}) poses.push_back(pose_of(a).cast<S>());
  std::vector<Eigen::Matrix<S, 3, 1>> landmarks;
  std::vector<BundleObservation<S>> observations;
  for (std::size_t j = 0; j < points().size(); ++j) {
    landmarks.push_back(points()[j].cast<S>());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Matrix<S, 3, 1> p_c = poses[i] * landmarks[j];
      observations.push_back(
          {static_cast<int>(i), static_cast<int>(j), *camera.project(p_c), p_c.z(), S(1), S(400)});
    }
  }
  const std::vector<std::uint8_t> fixed{1, 1, 0};
  poses[2] = pose_of(0.9).cast<S>();
  for (auto& p : landmarks) p.x() += S(0.01);
  auto again = poses;
  auto others = landmarks;
  BundleWorkspace<S> workspace;
  BundleOptions<S> options;
  options.max_iterations = 30;
  const auto result = bundle_adjust(camera, BundleProblem<S>{poses, fixed, landmarks, observations}, options,
                                    Huber<S>(), workspace);
  out.put("bundle_adjust.ok", result.ok());
  put_pose(out, "bundle_adjust", poses[2]);
  out.put("bundle_adjust.point", landmarks[7].template cast<double>());
  out.put("bundle_adjust.short",
          bundle_adjust(camera, BundleProblem<S>{again, fixed, others, observations}, options).ok());
}

template <class Camera>
void two_views(test::Record<double>& out) {
  using S = typename Camera::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const auto camera = test::conformance_camera<Camera>();
  const auto pinhole = ideal_pinhole(camera);
  const SE3<S> T = pose_of(1.5).cast<S>();
  std::vector<Vector2> x, x_m, y, y_m;
  for (const auto& p : points()) {
    const Eigen::Matrix<S, 3, 1> p_ref = p.cast<S>(), plane(p_ref.x(), p_ref.y(), S(3));
    x.push_back(*camera.project(p_ref));
    x_m.push_back(*camera.project(T * p_ref));
    y.push_back(*pinhole.project(plane));
    y_m.push_back(*pinhole.project(T * plane));
  }
  using Points = std::span<const Vector2>;
  TwoViewWorkspace<S> workspace;
  TwoViewOptions<S> options;
  options.min_parallax_px = S(1);
  const auto views = two_view_geometry(camera, Points(x), Points(x_m), options, workspace);
  out.put("two_view.model", static_cast<double>(views.model));
  out.put("two_view.inliers", views.inliers);
  const auto H = homography_dlt<S>(Points(y), Points(y_m));
  REQUIRE(H.has_value());
  out.put("homography_dlt",
          (*H / (*H)(2, 2) - *H / (*H)(2, 2) + Eigen::Matrix<S, 3, 3>::Identity()).template cast<double>());
  out.put("homography_dlt.error",
          symmetric_transfer_distance_squared<S>(*H, H->inverse(), y[3], y_m[3]) < S(1e-3));
  RansacWorkspace ransac;
  RansacOptions<S> limits;
  limits.max_iterations = options.ransac.max_iterations = 50;
  out.put("homography_ransac", homography_ransac<S>(Points(y), Points(y_m), limits, ransac).inliers);
  std::vector<Vector2> p, p_m;
  for (const auto& point : points()) {
    p.push_back(*pinhole.project(point.cast<S>()));
    p_m.push_back(*pinhole.project(T * point.cast<S>()));
  }
  out.put("fundamental_ransac", fundamental_ransac<S>(Points(p), Points(p_m), limits, ransac).inliers);
  out.put("fundamental_ransac.short", fundamental_ransac<S>(Points(p), Points(p_m), limits).inliers);
  const auto F = fundamental_eight_point<S>(Points(p), Points(p_m));
  REQUIRE(F.has_value());
  out.put("fundamental_eight_point", line_distance(*F, p[5], p_m[5]) < S(0.05));
  out.put("baseline",
          baseline_verdict<S>(Points(x), Points(x_m), camera, T.so3(), S(2)) == Baseline::sufficient);
  std::vector<PixelRay<double>> r, r_m, s, s_m;
  for (std::size_t i = 0; i < x.size(); ++i) {
    r.push_back(detail::ray_in_double(*pixel_ray_at(camera, x[i])));
    r_m.push_back(detail::ray_in_double(*pixel_ray_at(camera, x_m[i])));
    s.push_back(detail::ray_in_double(*pixel_ray(camera, pinhole.ray(y[i]))));
    s_m.push_back(detail::ray_in_double(*pixel_ray(camera, pinhole.ray(y_m[i]))));
  }
  const RansacOptions<double> of_rays{.max_iterations = 50};
  out.put("fundamental_ransac.rays", fundamental_ransac(r, r_m, of_rays, ransac).inliers);
  out.put("homography_ransac.rays", homography_ransac(s, s_m, of_rays, ransac).inliers);
  out.put("essential_ransac.rays", essential_ransac(r, r_m, of_rays, ransac).inliers);
  EssentialWorkspace essential;
  const auto E = essential_ransac(camera, x, x_m, limits, essential);
  out.put("essential_ransac", E.inliers);
  out.put("essential_ransac.short", essential_ransac(camera, x, x_m).inliers);
  const Eigen::Matrix<S, 3, 3> of_pose = essential_from_pose(T);
  double nearest = 10;
  for (const SE3<S>& pose : poses_from_essential<S>(of_pose))
    nearest = std::min(nearest, static_cast<double>((pose.so3() * T.so3().inverse()).log().norm()));
  out.put("poses_from_essential", nearest < 1e-3);
}

template <class Camera>
test::Record<double> camera_results() {
  test::Record<double> out;
  windows<Camera>(out);
  two_views<Camera>(out);
  return out;
}

}  // namespace

TEST_CASE_TEMPLATE("a window and two views have the same answer with every camera, in float and double",
                   Camera, DYNSLAM_CONFORMANCE_EACH_CAMERA) {
  static const auto expected = camera_results<Pinhole<double>>();
  test::check_same(camera_results<Camera>(), expected, 3e-3);
}
