// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/runtime/io/map_classes.hpp"

namespace dynslam::python {

/// A map of voxels that never changes.
struct Map {
  std::shared_ptr<const interop::SemanticOcTree> tree;
  runtime::MapClasses classes;
};

}  // namespace dynslam::python
