// SPDX-License-Identifier: BSD-3-Clause
// F, H and poses from pixels beside OpenCV's USAC on the same scenes: the same threshold, as many iterations.
#include <doctest/doctest.h>

#include <cstddef>
#include <span>
#include <vector>

#include <opencv2/calib3d.hpp>

#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/optim/absolute_pose.hpp"
#include "matched_scene.hpp"

using namespace dynslam;

namespace {

using RivalKind = test::MatchedScene::Kind;
constexpr double kRivalThreshold = 1.5, kRivalConfidence = 0.99;
constexpr int kRivalIterations = 1000;

std::vector<cv::Point2d> in_opencv(const std::vector<Eigen::Vector2d>& points) {
  std::vector<cv::Point2d> all;
  for (const auto& p : points) all.emplace_back(p.x(), p.y());
  return all;
}
Eigen::Matrix3d from_opencv(const cv::Mat& m) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 9 && m.rows == 3; ++i) M(i / 3, i % 3) = m.at<double>(i / 3, i % 3);
  return M;
}
RansacOptions<double> rival_options() {
  RansacOptions<double> options;
  options.threshold_px = kRivalThreshold;
  options.confidence = kRivalConfidence;
  options.max_iterations = kRivalIterations;
  return options;
}

/// Median errors of ours, USAC_MAGSAC and USAC_ACCURATE over 25 scenes.
struct Medians {
  double ours, magsac, accurate;
};
template <class Ours, class Theirs>
Medians medians(const char* name, RivalKind kind, double wrong, const Ours& ours, const Theirs& theirs) {
  test::Rng rng(name);
  std::vector<double> errors[3];
  for (int k = 0; k < 25; ++k) {
    const test::MatchedScene scene(rng, kind, 600, wrong, 0.5);
    const auto x = in_opencv(scene.x), x_m = in_opencv(scene.x_m);
    errors[0].push_back(ours(scene));
    errors[1].push_back(theirs(scene, x, x_m, cv::USAC_MAGSAC));
    errors[2].push_back(theirs(scene, x, x_m, cv::USAC_ACCURATE));
  }
  return {test::quantile(errors[0], 0.5), test::quantile(errors[1], 0.5), test::quantile(errors[2], 0.5)};
}

}  // namespace

TEST_CASE("F is as near to the truth as OpenCV's USAC_MAGSAC and USAC_ACCURATE") {
  RansacWorkspace workspace;
  double ours = 0, magsac = 0, accurate = 0;
  for (const RivalKind kind : {RivalKind::room, RivalKind::mostly_plane, RivalKind::small_baseline}) {
    for (const double wrong : {0.2, 0.5}) {
      const Medians m = medians(
          "F beside OpenCV", kind, wrong,
          [&](const auto& scene) {
            using Points = std::span<const Eigen::Vector2d>;
            return scene.error_of_fundamental(
                fundamental_ransac<double>(Points(scene.x), Points(scene.x_m), rival_options(), workspace).F);
          },
          [](const auto& scene, const auto& x, const auto& x_m, int method) {
            return scene.error_of_fundamental(from_opencv(
                cv::findFundamentalMat(x, x_m, method, kRivalThreshold, kRivalConfidence, kRivalIterations)));
          });
      CAPTURE(static_cast<int>(kind));
      CAPTURE(wrong);
      CHECK(m.ours < 1.1 * m.magsac);
      CHECK(m.ours < 1.1 * m.accurate);
      ours += m.ours;
      magsac += m.magsac;
      accurate += m.accurate;
    }
  }
  CHECK(ours < magsac);
  CHECK(ours < accurate);
}

TEST_CASE("H is as near to the truth as OpenCV's USAC_MAGSAC and USAC_ACCURATE") {
  RansacWorkspace workspace;
  for (const double wrong : {0.2, 0.5}) {
    const Medians m = medians(
        "H beside OpenCV", RivalKind::mostly_plane, wrong,
        [&](const auto& scene) {
          using Points = std::span<const Eigen::Vector2d>;
          const auto found =
              homography_ransac<double>(Points(scene.x), Points(scene.x_m), rival_options(), workspace);
          return found.model ? scene.error_of_homography(*found.model) : 1e3;
        },
        [](const auto& scene, const auto& x, const auto& x_m, int method) {
          return scene.error_of_homography(from_opencv(cv::findHomography(
              x, x_m, method, kRivalThreshold, cv::noArray(), kRivalIterations, kRivalConfidence)));
        });
    CAPTURE(wrong);
    CHECK(m.ours < 1.1 * m.magsac);
    CHECK(m.ours < 1.1 * m.accurate);
  }
}

TEST_CASE("a pose from pixels alone is as near to the truth as OpenCV's USAC with P3P") {
  const auto& camera = test::kFreiburg3;
  const cv::Matx33d K(camera.fx(), 0, camera.cx(), 0, camera.fy(), camera.cy(), 0, 0, 1);
  test::Rng rng("P3P beside OpenCV");
  AbsolutePoseWorkspace workspace;
  for (const double wrong : {0.2, 0.5, 0.7}) {
    std::vector<double> ours, theirs;
    for (int k = 0; k < 25; ++k) {
      SE3d::Vector6 xi;
      for (int i = 0; i < 6; ++i) xi(i) = rng.uniform(-1, 1);
      const SE3d truth = SE3d::exp(xi);
      std::vector<PoseObservation<double>> observations;
      std::vector<cv::Point3d> points;
      std::vector<cv::Point2d> pixels;
      for (int i = 0; i < 300; ++i) {
        Eigen::Vector2d x(rng.uniform(0, 640), rng.uniform(0, 480));
        const Eigen::Vector3d p_w = truth.inverse() * Eigen::Vector3d(camera.ray(x) * rng.uniform(1, 4));
        x += Eigen::Vector2d(rng.normal(), rng.normal());
        if (rng.chance(wrong)) x = {rng.uniform(0, 640), rng.uniform(0, 480)};
        observations.emplace_back(p_w, x);
        points.emplace_back(p_w.x(), p_w.y(), p_w.z());
        pixels.emplace_back(x.x(), x.y());
      }
      const auto error = [&](const SE3d& T) { return (T * truth.inverse()).log().norm(); };
      ours.push_back(error(absolute_pose<double>(camera, observations, {}, workspace).T_c_w));
      cv::Vec3d r, t;
      std::vector<int> inliers;
      REQUIRE(cv::solvePnPRansac(points, pixels, K, cv::noArray(), r, t, false, 300, 4.0F, 0.999, inliers,
                                 cv::USAC_DEFAULT));
      theirs.push_back(
          error(SE3d(SO3d::exp(Eigen::Vector3d(r[0], r[1], r[2])), Eigen::Vector3d(t[0], t[1], t[2]))));
    }
    CAPTURE(wrong);
    CHECK(test::quantile(ours, 0.5) < test::quantile(theirs, 0.5));
    CHECK(test::quantile(ours, 0.9) < 1.2 * test::quantile(theirs, 0.9));
  }
}
