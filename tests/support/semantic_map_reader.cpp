// SPDX-License-Identifier: BSD-3-Clause
// A program of another project that knows OctoMap and one header of dynslam: OctoMap's own functions read the
// map and answer.
//
//   semantic_map_reader FILE    type, resolution and nodes, a line per occupied leaf (key, depth, label,
//   colour), and
//                               where a ray along z ends
#include <dynslam/interop/octomap_semantic_tree.hpp>

#include <cstdio>
#include <memory>

int main(int argc, char** argv) {
  if (argc != 2) return std::fputs("usage: semantic_map_reader FILE\n", stderr), 2;
  const std::unique_ptr<octomap::AbstractOcTree> any(octomap::AbstractOcTree::read(argv[1]));
  const auto* tree = dynamic_cast<dynslam::interop::SemanticOcTree*>(any.get());
  if (tree == nullptr) return 3;
  std::printf("%s %.17g %zu\n", tree->getTreeType().c_str(), tree->getResolution(), tree->size());
  for (auto it = tree->begin_leafs(), end = tree->end_leafs(); it != end; ++it) {
    if (!tree->isNodeOccupied(*it)) continue;
    const octomap::OcTreeKey key = it.getKey();
    const auto c = it->colour();
    std::printf("%u %u %u %u %u %u %u %u\n", unsigned(key[0]), unsigned(key[1]), unsigned(key[2]),
                it.getDepth(), unsigned(it->label()), unsigned(c[0]), unsigned(c[1]), unsigned(c[2]));
  }
  octomap::point3d end;
  const bool hit = tree->castRay({0.0F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.0F}, end, true);
  std::printf("ray %d %.9g %.9g %.9g\n", hit ? 1 : 0, double(end.x()), double(end.y()), double(end.z()));
  return 0;
}
