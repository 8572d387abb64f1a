// SPDX-License-Identifier: BSD-3-Clause
// Ceres as an independent oracle of the pose optimisation: same residuals, same loss, same minimum.
#include "ceres_oracle.hpp"

#ifdef DYNSLAM_HAVE_CERES
#include <vector>

#include "dynslam/optim/pose.hpp"
#include "random.hpp"
#include "tum_cameras.hpp"

using namespace dynslam;

namespace {

struct Residual {
  PoseObservation<double> o;
  template <class T>
  bool operator()(const T* angle_axis, const T* translation, T* r) const {
    const T p_w[3] = {T(o.p_w.x()), T(o.p_w.y()), T(o.p_w.z())};
    T p[3];
    ceres::AngleAxisRotatePoint(angle_axis, p_w, p);
    for (int i = 0; i < 3; ++i) p[i] += translation[i];
    r[0] =
        (test::kFreiburg3.fx() * p[0] / p[2] + test::kFreiburg3.cx() - o.x.x()) * std::sqrt(o.inv_sigma_px2);
    r[1] =
        (test::kFreiburg3.fy() * p[1] / p[2] + test::kFreiburg3.cy() - o.x.y()) * std::sqrt(o.inv_sigma_px2);
    r[2] = (p[2] - o.depth) * std::sqrt(o.inv_sigma_z2);
    return true;
  }
};

}  // namespace

TEST_CASE("the optimum is Ceres' optimum of the same robust cost") {
  test::Rng rng("ceres");
  for (int trial = 0; trial < 5; ++trial) {
    std::vector<PoseObservation<double>> observations;
    const SE3d truth =
        SE3d::exp((Eigen::Matrix<double, 6, 1>() << 0.2, 0.1, -0.1, 0.1, 0.2, -0.1).finished());
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector2d x(rng.uniform(0, 640), rng.uniform(0, 480));
      const double z = rng.uniform(1, 4);
      const Eigen::Vector3d p_c = test::kFreiburg3.ray(x) * z;
      const double gross = i < 30 ? 8.0 : 0.0;
      observations.push_back({truth.inverse() * p_c, x + Eigen::Vector2d(rng.normal() + gross, rng.normal()),
                              z + 0.02 * rng.normal(), 1.0, 2500.0});
    }
    PoseOptions<double> options;
    options.rounds = 1;  // the same observations as Ceres
    options.max_iterations = 100;
    options.tolerance = 1e-12;
    PoseWorkspace<double> workspace;
    const auto ours = optimize_pose<double>(test::kFreiburg3, observations, SE3d(), options,
                                            TDistribution<double>::with_dimension(5.0, 1), workspace);

    double angle_axis[3] = {0, 0, 0}, translation[3] = {0, 0, 0};
    ceres::Problem problem;
    for (const auto& o : observations) {
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Residual, 3, 3, 3>(new Residual{o}),
                               new test::TLoss, angle_axis, translation);
    }
    ceres::Solver::Options solver;
    solver.max_num_iterations = 200;
    solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 1e-14;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    const SE3d theirs(SO3d::exp(Eigen::Vector3d(angle_axis[0], angle_axis[1], angle_axis[2])),
                      Eigen::Vector3d(translation[0], translation[1], translation[2]));
    CHECK((ours.T_c_w * theirs.inverse()).log().norm() < 1e-6);
  }
}

TEST_CASE("residual and chi-square take Ceres' dual numbers") {
  using Jet = ceres::Jet<double, 6>;
  test::Rng rng("pose jets");
  const SE3d T = SE3d::exp((Eigen::Matrix<double, 6, 1>() << 0.2, 0.1, -0.1, 0.1, 0.2, -0.1).finished());
  Eigen::Matrix<Jet, 6, 1> delta;
  for (int k = 0; k < 6; ++k) delta(k) = Jet(0.0, k);
  const SE3<Jet> varied = SE3<Jet>::exp(delta) * T.cast<Jet>();
  for (int i = 0; i < 20; ++i) {
    PoseObservation<double> o;
    const double z = rng.uniform(1, 4);
    o.p_w = T.inverse() * Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1), z);
    o.x = Eigen::Vector2d(rng.uniform(0, 640), rng.uniform(0, 480));
    o.depth = z + 0.1;
    o.inv_sigma_z2 = 100;
    const PoseObservation<Jet> lifted{o.p_w.cast<Jet>(), o.x.cast<Jet>(), Jet(o.depth), Jet(o.inv_sigma_px2),
                                      Jet(o.inv_sigma_z2)};
    Eigen::Vector3d r;
    Eigen::Matrix<double, 3, 6> J;
    REQUIRE(pose_residual<double>(test::kFreiburg3, T, o, r, &J));
    Eigen::Matrix<Jet, 3, 1> dual;
    REQUIRE(pose_residual<Jet>(test::kFreiburg3.cast<Jet>(), varied, lifted, dual));
    for (int k = 0; k < 3; ++k) {
      CHECK(dual(k).a == doctest::Approx(r(k)));
      CHECK((dual(k).v.transpose() - J.row(k)).norm() < 1e-9 * (1 + J.row(k).norm()));
    }
    CHECK(observation_chi2<Jet>(test::kFreiburg3.cast<Jet>(), varied, lifted).a ==
          doctest::Approx(observation_chi2<double>(test::kFreiburg3, T, o)));
  }
}
#else
DYNSLAM_SKIP_WITHOUT_CERES("the optimum is Ceres' optimum of the same robust cost")
#endif
