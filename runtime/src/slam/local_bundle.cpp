// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/local_bundle.hpp"

#include "dynslam/robust/t_distribution.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {

void LocalBundle::start(const LocalMap& map, const DepthNoise<double>& noise, int window) {
  if (pending()) running_.wait();  // for its copy of the map is about to be replaced
  window_.collect(map, noise, window);
  running_ = std::async(std::launch::async, [this] {
    step_back(StepBack::some);
    return bundle_adjust<double>(camera_, window_.problem(), options_.solver,
                                 TDistribution<double>::with_dimension(options_.nu, 1), workspace_);
  });
}

SE3<double> LocalBundle::apply(LocalMap& map) {
  return running_.get().ok() ? window_.apply(camera_, map) : SE3<double>();
}

}  // namespace dynslam::runtime
