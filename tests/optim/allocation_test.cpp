// SPDX-License-Identifier: BSD-3-Clause
// What promises to allocate nothing once its workspace is warm is held to it by counting.
#include "allocations.hpp"

#include <doctest/doctest.h>

#include <memory>
#include <vector>

#include "bundle_window.hpp"
#include "dynslam/optim/absolute_pose.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
std::vector<PoseObservation<S>> sights(test::Rng& rng, int n) {
  const Pinhole<double> camera = test::kFreiburg3;
  std::vector<PoseObservation<S>> all;
  for (int k = 0; k < n; ++k) {
    const Eigen::Vector2d x(rng.uniform(0, 640), rng.uniform(0, 480));
    const double z = rng.uniform(1, 4);
    const Eigen::Vector3d p((x.x() - camera.cx()) / camera.fx() * z, (x.y() - camera.cy()) / camera.fy() * z,
                            z);
    PoseObservation<S> o;
    o.p_w = p.cast<S>();
    o.x = (x + Eigen::Vector2d(rng.normal(), rng.normal())).cast<S>();
    o.depth = static_cast<S>(z + 0.01 * rng.normal());
    o.inv_sigma_z2 = S(1e4);
    all.push_back(o);
  }
  return all;
}

void* volatile taken = nullptr;  // keeps the compiler from leaving out what is counted

}  // namespace

TEST_CASE("the counter counts: operator new, vectors, Eigen's matrices, nothing else") {
  if (!test::counts_allocations()) {
    MESSAGE("SKIPPED: this build cannot count allocations");
    return;
  }
  CHECK(test::allocations_of([] {
          auto one = std::make_unique<int>(1);
          taken = one.get();
        }) == 1);
  CHECK(test::allocations_of([] {
          std::vector<double> v(100);
          taken = v.data();
          v.resize(1000);
          taken = v.data();
        }) == 2);
  CHECK(test::allocations_of([] {
          Eigen::MatrixXd m(10, 10);
          taken = m.data();
        }) == 1);
  CHECK(test::allocations_of([] {
          const Eigen::Matrix4d m = Eigen::Matrix4d::Identity() * 2;
          volatile double x = m(0, 0);
          (void)x;
        }) == 0);
}

TEST_CASE_TEMPLATE("with a warm workspace the pose is found without allocation", S, float, double) {
  test::Rng rng("pose allocation");
  const auto all = sights<S>(rng, 300);
  const std::vector<PoseObservation<S>> few(all.begin(), all.begin() + 100);
  const Pinhole<S> camera = test::kFreiburg3.cast<S>();
  const auto kernel = TDistribution<S>::with_dimension(S(5), 1);
  PoseWorkspace<S> workspace;
  PoseOptions<S> options;
  options.min_pixel_scale = S(0.5);  // the branch that needs scratch memory
  const auto run = [&](const std::vector<PoseObservation<S>>& o) {
    const auto result = optimize_pose<S>(camera, o, SE3<S>(), options, kernel, workspace);
    CHECK(result.ok());
  };
  if (test::counts_allocations()) CHECK(test::allocations_of([&] { run(all); }) > 0);
  CHECK(test::allocations_of([&] { run(all); }) == 0);
  CHECK(test::allocations_of([&] { run(few); }) == 0);
}

TEST_CASE_TEMPLATE("with a warm workspace consensus and absolute pose allocate nothing", S, float, double) {
  test::Rng rng("consensus allocation");
  const auto all = sights<S>(rng, 200);
  const std::vector<S> weights(all.size(), S(1));
  const Pinhole<S> camera = test::kFreiburg3.cast<S>();
  PoseConsensusWorkspace flags;
  const auto consensus = [&] {
    CHECK(pose_consensus<S>(camera, all, weights, SE3<S>(), {}, {}, flags).inliers > 100);
  };
  consensus();
  CHECK(test::allocations_of(consensus) == 0);
  AbsolutePoseWorkspace workspace;
  const auto absolute = [&] { CHECK(absolute_pose<S>(camera, all, {}, workspace).inliers > 100); };
  absolute();
  CHECK(test::allocations_of(absolute) == 0);
}

TEST_CASE("with a warm workspace a window is adjusted without allocation") {
  test::Rng rng("bundle allocation");
  const test::Window window = test::make_window(rng, 8, 100, 0.05);
  BundleWorkspace<double> workspace;
  const auto run = [&](test::Window& w) {
    CHECK(bundle_adjust<double>(test::kFreiburg3, w.problem(), {},
                                TDistribution<double>::with_dimension(5, 1), workspace)
              .ok());
  };
  test::Window first = window, second = window;
  if (test::counts_allocations()) CHECK(test::allocations_of([&] { run(first); }) > 0);
  CHECK(test::allocations_of([&] { run(second); }) == 0);
}
