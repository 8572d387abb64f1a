// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <octomap/ColorOcTree.h>

#include <Eigen/Core>
#include <concepts>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/semantic/log_odds.hpp"

namespace dynslam::interop {

/// OctoMap's point of an Eigen vector [m] (OctoMap is single precision).
template <FixedMatrix<3> D>
[[nodiscard]] octomap::point3d to_octomap(const Eigen::MatrixBase<D>& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

/// Sets an occupancy tree's sensor model and clamping from log-odds parameters.
template <class Tree, std::floating_point S>
void set_parameters(Tree& tree, const LogOddsParams<S>& params) {
  tree.setProbHit(static_cast<double>(log_odds_to_probability(params.hit)));
  tree.setProbMiss(static_cast<double>(log_odds_to_probability(params.miss)));
  tree.setClampingThresMin(static_cast<double>(log_odds_to_probability(params.min)));
  tree.setClampingThresMax(static_cast<double>(log_odds_to_probability(params.max)));
  tree.setOccupancyThres(static_cast<double>(log_odds_to_probability(params.occupied)));
}

/// State of the space at a point, from any OctoMap occupancy tree.
template <class Tree>
[[nodiscard]] Occupancy occupancy(const Tree& tree, const octomap::point3d& p) {
  const auto* node = tree.search(p);
  if (node == nullptr) return Occupancy::unknown;
  return tree.isNodeOccupied(node) ? Occupancy::occupied : Occupancy::free;
}

}  // namespace dynslam::interop

#include "dynslam/pop_macros.hpp"
