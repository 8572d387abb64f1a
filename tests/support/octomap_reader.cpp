// SPDX-License-Identifier: BSD-3-Clause
// What a program that knows OctoMap alone makes of a map: no header of dynslam is included, nothing but
// liboctomap linked. Files are opened as octovis opens them, a .bt as an OcTree, everything else by its type.
//
//   octomap_reader FILE     type, resolution and nodes, then a line per occupied leaf: key, depth, and colour
//                           where the tree has one; exits with 3 where OctoMap does not know the file
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <cstdio>
#include <memory>
#include <string>

namespace {

template <class Tree, class Print>
void print_leafs(const Tree& tree, Print&& print_colour) {
  std::printf("%s %.17g %zu\n", tree.getTreeType().c_str(), tree.getResolution(), tree.size());
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const octomap::OcTreeKey key = it.getKey();
    std::printf("%u %u %u %u", unsigned(key[0]), unsigned(key[1]), unsigned(key[2]), it.getDepth());
    print_colour(*it);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fputs("usage: octomap_reader FILE\n", stderr), 2;
  const std::string file = argv[1];
  std::unique_ptr<octomap::AbstractOcTree> tree;
  if (file.size() > 3 && file.compare(file.size() - 3, 3, ".bt") == 0) {
    tree = std::make_unique<octomap::OcTree>(file);
  } else {
    tree.reset(octomap::AbstractOcTree::read(file));
  }
  if (const auto* colour = dynamic_cast<octomap::ColorOcTree*>(tree.get())) {
    print_leafs(*colour, [](const octomap::ColorOcTreeNode& node) {
      const auto c = node.getColor();
      std::printf(" %u %u %u", unsigned(c.r), unsigned(c.g), unsigned(c.b));
    });
    return 0;
  }
  if (const auto* plain = dynamic_cast<octomap::OcTree*>(tree.get())) {
    print_leafs(*plain, [](const octomap::OcTreeNode&) {});
    return 0;
  }
  return 3;
}
