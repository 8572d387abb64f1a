// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/pose.hpp"
#include "support/rng.hpp"

namespace dynslam::bench {

/// Camera of the fr3 sequences of TUM RGB-D.
template <class S>
[[nodiscard]] Pinhole<S> camera() {
  return Pinhole<S>(S(535.4), S(539.2), S(320.1), S(247.6));
}

/// Points in the view of a camera at `T_c_w`, their pixels with normal noise of 1 px, depths with that of a
/// structured-light camera (Khoshelham 2012), and a share of gross outliers, which tell of another place in
/// the image.
template <class S>
struct PoseProblem {
  SE3<S> T_c_w;
  SE3<S> initial;
  std::vector<PoseObservation<S>> observations;
};

template <class S>
[[nodiscard]] PoseProblem<S> pose_problem(int points, double outliers, std::uint64_t seed = 7) {
  Random random(seed);
  Eigen::Matrix<S, 6, 1> truth;
  truth << S(0.3), S(-0.2), S(0.1), S(0.05), S(-0.1), S(0.2);
  Eigen::Matrix<S, 6, 1> error;
  error << S(0.02), S(0.03), S(-0.02), S(0.01), S(-0.02), S(0.01);

  PoseProblem<S> problem;
  problem.T_c_w = SE3<S>::exp(truth);
  problem.initial = SE3<S>::exp(error) * problem.T_c_w;
  const Pinhole<S> pinhole = camera<S>();
  const SE3<S> T_w_c = problem.T_c_w.inverse();
  for (int i = 0; i < points; ++i) {
    Eigen::Matrix<S, 2, 1> x(S(random.uniform(20, 620)), S(random.uniform(20, 460)));
    const S z = S(random.uniform(0.8, 5.0));
    PoseObservation<S> observation{};
    observation.p_w = T_w_c * Eigen::Matrix<S, 3, 1>(pinhole.ray(x) * z);
    x += Eigen::Matrix<S, 2, 1>(S(random.normal()), S(random.normal()));
    if (random.uniform(0.0, 1.0) < outliers) {
      x = Eigen::Matrix<S, 2, 1>(S(random.uniform(0, 640)), S(random.uniform(0, 480)));
    }
    const S sigma_z = S(0.001) + S(0.0019) * z * z;
    observation.x = x;
    observation.depth = z + sigma_z * S(random.normal());
    observation.inv_sigma_px2 = S(1);
    observation.inv_sigma_z2 = S(1) / (sigma_z * sigma_z);
    problem.observations.push_back(observation);
  }
  return problem;
}

}  // namespace dynslam::bench
