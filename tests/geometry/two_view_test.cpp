// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/two_view.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/se3.hpp"
#include "moved_camera.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {

enum class Scene { room, plane };

template <class C>
struct MatchedViews {
  using S = typename C::ScalarType;
  std::vector<Eigen::Matrix<S, 2, 1>> x, x_m;
  std::size_t outliers = 0;  // the first ones
};

/// Matches with 0.3 px of noise; the first ones are wrong by anything.
template <class C>
MatchedViews<C> make_views(test::Rng& rng, const C& camera, Scene scene, const SE3d& T, int n,
                           double outliers) {
  using S = typename C::ScalarType;
  MatchedViews<C> views;
  const SE3<S> motion = T.cast<S>();
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.1, 1).normalized();
  views.outliers = static_cast<std::size_t>(outliers * n);
  while (static_cast<int>(views.x.size()) < n) {
    const Eigen::Matrix<S, 2, 1> x(S(rng.uniform(40, 600)), S(rng.uniform(40, 440)));
    const auto ray = camera.unproject(x, S(1));
    if (!ray) continue;
    const S z =
        scene == Scene::plane ? S(2.0 / normal.dot(ray->template cast<double>())) : S(rng.uniform(1, 5));
    const auto x_m = camera.project(motion * (*ray * z));
    if (!x_m) continue;
    views.x.push_back(x);
    views.x_m.push_back(*x_m + S(0.3) * Eigen::Matrix<S, 2, 1>(S(rng.normal()), S(rng.normal())));
    if (views.x.size() <= views.outliers) views.x_m.back() = {S(rng.uniform(0, 640)), S(rng.uniform(0, 480))};
  }
  return views;
}

struct Tally {
  int none = 0, homography = 0, fundamental = 0;
  int accused = 0, judged = 0;  // static points farther than 3 px from the model
};

template <class C>
Tally try_scenes(const std::string& name, const C& camera, Scene scene, double baseline, double outliers) {
  using S = typename C::ScalarType;
  test::Rng rng(name);
  TwoViewWorkspace<S> workspace;
  TwoViewOptions<S> options;
  options.ransac.threshold_px = S(1.5);
  options.ransac.max_iterations = 400;
  Tally tally;
  for (int k = 0; k < 20; ++k) {
    const double a = rng.uniform(-3, 3);
    const SE3d T =
        test::moved(baseline * std::cos(a), baseline * std::sin(a), 0.2 * baseline, rng.uniform(-0.06, 0.06));
    const auto v = make_views(rng, camera, scene, T, 200, outliers);
    using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
    const auto found = two_view_geometry(camera, Points(v.x), Points(v.x_m), options, workspace);
    tally.none += found.model == TwoViewModel::none ? 1 : 0;
    tally.homography += found.model == TwoViewModel::homography ? 1 : 0;
    tally.fundamental += found.model == TwoViewModel::fundamental ? 1 : 0;
    for (std::size_t i = v.outliers; i < v.x.size() && found.ok(); ++i) {
      ++tally.judged;
      tally.accused += found.distance_px[i] > S(3) ? 1 : 0;
    }
  }
  return tally;
}

}  // namespace

TEST_CASE_TEMPLATE("a plane is a homography, with up to 40 % outliers (F misplaced its static points)", S,
                   float, double) {
  for (const double outliers : {0.0, 0.2, 0.4}) {
    CAPTURE(outliers);
    const Tally t = try_scenes("plane", test::kFreiburg3.cast<S>(), Scene::plane, 0.2, outliers);
    CHECK(t.homography >= 19);
    CHECK(t.accused * 100 < t.judged);
  }
}

TEST_CASE_TEMPLATE("a room seen from two places is a fundamental matrix, with up to 40 % outliers", S, float,
                   double) {
  for (const double outliers : {0.0, 0.2, 0.4}) {
    CAPTURE(outliers);
    const Tally t = try_scenes("room", test::kFreiburg3.cast<S>(), Scene::room, 0.25, outliers);
    CHECK(t.fundamental >= 19);
    CHECK(t.accused * 50 < t.judged);
  }
}

TEST_CASE_TEMPLATE("pure rotation and a hair of a baseline are homographies", S, float, double) {
  for (const double baseline : {0.0, 0.001}) {
    for (const double outliers : {0.0, 0.4}) {
      CAPTURE(baseline);
      CAPTURE(outliers);
      const Tally t = try_scenes("rotation", test::kFreiburg3.cast<S>(), Scene::room, baseline, outliers);
      CHECK(t.homography >= 19);
      CHECK(t.accused * 100 < t.judged);
    }
  }
}

TEST_CASE_TEMPLATE("the verdict is reached through lenses of any kind", S, float, double) {
  const PinholeBrownConrady<S> lens(Pinhole<S>(S(517.3), S(516.5), S(318.6), S(255.3)),
                                    BrownConrady<S>(S(0.2624), S(-0.9531), S(-0.0054), S(0.0026), S(1.1633)));
  const KannalaBrandt<S> fisheye(S(350), S(350), S(320), S(240),
                                 Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.004), S(-0.001), S(0)));
  CHECK(try_scenes("lens", lens, Scene::plane, 0.2, 0.2).homography >= 19);
  CHECK(try_scenes("lens", lens, Scene::room, 0.25, 0.2).fundamental >= 19);
  CHECK(try_scenes("fisheye", fisheye, Scene::plane, 0.2, 0.2).homography >= 19);
  CHECK(try_scenes("fisheye", fisheye, Scene::room, 0.25, 0.2).fundamental >= 19);
}

TEST_CASE("matches that share nothing, and too few, have no model and no distances") {
  test::Rng rng("nothing");
  const auto v = make_views(rng, test::kFreiburg3, Scene::room, SE3d(), 60, 1.0);
  using Points = std::span<const Eigen::Vector2d>;
  const auto random = two_view_geometry(test::kFreiburg3, Points(v.x), Points(v.x_m));
  CHECK_FALSE(random.ok());
  CHECK(std::isnan(random.distance_px[0]));
  CHECK_FALSE(two_view_geometry(test::kFreiburg3, Points(v.x).first(5), Points(v.x_m).first(5)).ok());
  CHECK_FALSE(two_view_geometry(test::kFreiburg3, Points(), Points()).ok());
}

TEST_CASE_TEMPLATE("vertical stereo is no plane, nor is any motion along an axis without a turn", S, float,
                   double) {
  // Fault: no sample of seven had an F, and the homography of the few was what was left.
  const Pinhole<S> camera = test::kFreiburg3.cast<S>();
  test::Rng rng("stereo");
  using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
  for (const Eigen::Vector3d& t :
       {Eigen::Vector3d(0.2, 0, 0), Eigen::Vector3d(0, 0.2, 0), Eigen::Vector3d(0, 0, 0.2)}) {
    CAPTURE(t.transpose());
    const auto v = make_views(rng, camera, Scene::room, SE3d(SO3d(), t), 300, 0.2);
    const auto found = two_view_geometry(camera, Points(v.x), Points(v.x_m));
    CHECK(found.model == TwoViewModel::fundamental);
    int accused = 0;
    for (std::size_t i = v.outliers; i < v.x.size(); ++i) accused += found.distance_px[i] > S(1.5) ? 1 : 0;
    CHECK(accused < 5);
  }
}

TEST_CASE_TEMPLATE("matches that are not finite are invalid, and nothing else is another for them", S, float,
                   double) {
  const auto camera = test::kFreiburg3.cast<S>();
  const S nan = std::numeric_limits<S>::quiet_NaN(), infinity = std::numeric_limits<S>::infinity();
  using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
  for (const Scene scene : {Scene::room, Scene::plane}) {
    test::Rng rng("invalid matches");
    auto v = make_views(rng, camera, scene, test::moved(0.25, 0.05, -0.05, 0.1), 200, 0.2);
    const auto without = two_view_geometry(camera, Points(v.x), Points(v.x_m));
    v.x.push_back({nan, S(0)});
    v.x_m.push_back({S(1), S(1)});
    v.x.push_back({S(1), S(1)});
    v.x_m.push_back({S(1), -infinity});
    const auto with = two_view_geometry(camera, Points(v.x), Points(v.x_m));
    CHECK(with.model == without.model);
    CHECK(with.matrix == without.matrix);
    CHECK(with.inliers == without.inliers);
    for (std::size_t i = 0; i < v.x.size(); ++i) {
      CHECK((with.invalid[i] != 0) == (i >= 200));
      CHECK(std::isnan(with.distance_px[i]) == (i >= 200));
    }
    // Finite, but nothing that a camera sees: outliers like others.
    for (const S far : {S(1e6), S(1e15)}) {
      CAPTURE(far);
      v.x_m[200] = v.x_m[201] = {far, S(-1)};
      v.x[200] = v.x[201] = {S(100), S(100)};
      const auto outliers = two_view_geometry(camera, Points(v.x), Points(v.x_m));
      CHECK(outliers.model == without.model);
      CHECK(std::abs(outliers.inliers - without.inliers) < 4);
      CHECK(outliers.distance_px[200] > S(3));
    }
  }
}

TEST_CASE_TEMPLATE(
    "distances are those of recorded pixels, and the matrix that of ideal ones, through any lens", S, float,
    double) {
  const KannalaBrandt<S> camera(S(180), S(180), S(320), S(240),
                                Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.004), S(0), S(0)));
  const Pinhole<S> pinhole = ideal_pinhole(camera);
  test::Rng rng("recorded pixels");
  using Points = std::span<const Eigen::Matrix<S, 2, 1>>;
  for (const Scene scene : {Scene::room, Scene::plane}) {
    const SE3d T = test::moved(0.25, 0.1, -0.05, 0.05);
    auto v = make_views(rng, camera, Scene::room, T, 300, 0);
    if (scene == Scene::plane) v = make_views(rng, camera, scene, T, 300, 0);
    const auto found = two_view_geometry(camera, Points(v.x), Points(v.x_m));
    REQUIRE(found.ok());
    double sum = 0;
    for (std::size_t i = 0; i < v.x.size(); ++i) {
      sum += static_cast<double>(found.distance_px[i] * found.distance_px[i]);
      // Where the lens hardly bends, both agree.
      const auto a = to_ideal(camera, pinhole, v.x[i]), b = to_ideal(camera, pinhole, v.x_m[i]);
      REQUIRE((a && b));
      if ((*b - Eigen::Matrix<S, 2, 1>(S(320), S(240))).norm() > S(20)) continue;
      const S ideal = scene == Scene::room ? line_distance<S>(found.matrix, *a, *b)
                                           : std::sqrt(transfer_distance_squared<S>(found.matrix, *a, *b));
      CHECK(std::abs(found.distance_px[i] - ideal) < S(0.02));
    }
    // 0.3 px of noise in each coordinate: one of them across a line, both from a point.
    const double rms = std::sqrt(sum / static_cast<double>(v.x.size()));
    CHECK(rms == doctest::Approx(scene == Scene::room ? 0.3 : 0.3 * std::sqrt(2.0)).epsilon(0.12));
  }
}
