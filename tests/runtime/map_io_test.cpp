// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_io.hpp"

#include <doctest/doctest.h>
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/map_render.hpp"
#include "error_text.hpp"
#include "random.hpp"
#include "recorded_scans.hpp"
#include "tree_compare.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using interop::SemanticOcTree;
namespace fs = std::filesystem;

namespace {

SemanticOcTree room(double edge) {
  SemanticOcTree tree(edge);
  ScanVoxels voxels(tree.grid());
  for (const auto& scan : test::room_scans(4, 80, 60)) {
    gather_point_cloud(voxels, scan.points, scan.origin, 4.0, true);
    tree.integrate(voxels);
  }
  return tree;
}

std::string read(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string refusal(const fs::path& path) {
  const std::string error = test::error_of([&] { (void)load_map(path); });
  return error.empty() ? "accepted" : error;
}

}  // namespace

TEST_CASE("saving and loading is exact, before and after pruning") {
  const test::TemporaryFolder folder;
  SemanticOcTree tree = room(0.1);
  for (int pass = 0; pass < 2; ++pass) {
    save_map(tree, folder.path / "a.sot");
    const auto back = load_map(folder.path / "a.sot");
    CHECK(*back == tree);
    CHECK(back->getResolution() == 0.1);
    save_map(*back, folder.path / "b.sot");
    CHECK(read(folder.path / "a.sot") == read(folder.path / "b.sot"));
    tree.prune();
  }
  const SemanticOcTree empty(0.07);
  save_map(empty, folder.path / "empty.sot");
  const auto back = load_map(folder.path / "empty.sot");
  CHECK(back->size() == 0);
  CHECK(back->getResolution() == 0.07);
  CHECK(fs::directory_iterator(folder.path) != fs::directory_iterator());
  for (const auto& entry : fs::directory_iterator(folder.path)) CHECK(entry.path().extension() == ".sot");
}

TEST_CASE("exports: OctoMap reads them, with the same tree") {
  const test::TemporaryFolder folder;
  const SemanticOcTree tree = room(0.1);

  export_map(tree, folder.path / "c.ot");
  std::ifstream colour_file(folder.path / "c.ot", std::ios::binary);
  const std::unique_ptr<octomap::AbstractOcTree> read_colour(octomap::AbstractOcTree::read(colour_file));
  const auto* colour = dynamic_cast<const octomap::ColorOcTree*>(read_colour.get());
  REQUIRE(colour != nullptr);
  const auto same = test::compare_trees(tree, *colour);
  CHECK(same.first_fault == "");
  CHECK(same.largest_difference == 0.0);
  CHECK(colour->size() == tree.size());
  int chairs = 0;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const auto seen = colour->search(it.getKey())->getColor();
    const Rgb expected = voxel_colour(*it);
    CHECK(seen == octomap::ColorOcTreeNode::Color(expected[0], expected[1], expected[2]));
    chairs += it->label() == 2 ? 1 : 0;
  }
  CHECK(chairs > 20);

  SemanticOcTree lookalike(0.1);  // background of a chair's very colour
  ScanVoxels scan(lookalike.grid());
  scan.add_end(Eigen::Vector3f(0, 0, 0), 0, class_colour(2));
  scan.finish();
  lookalike.integrate(scan);
  CHECK(voxel_colour(*lookalike.search(0.0, 0.0, 0.0)) != class_colour(2));

  export_map(tree, folder.path / "b.bt");
  octomap::OcTree binary(1.0);
  std::ifstream binary_file(folder.path / "b.bt", std::ios::binary);
  REQUIRE(binary.readBinary(binary_file));
  CHECK(binary.getResolution() == 0.1);
  std::size_t occupied = 0;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    const auto* node = binary.search(it.getKey());
    REQUIRE(node != nullptr);
    CHECK(binary.isNodeOccupied(node) == tree.isNodeOccupied(*it));
    occupied += tree.isNodeOccupied(*it) ? 1 : 0;
  }
  CHECK(test::compare_trees(tree, binary).first_fault == "");

  export_map(tree, folder.path / "p.ply");
  std::istringstream ply(read(folder.path / "p.ply"));
  std::string line;
  std::size_t announced = 0, vertices = 0;
  while (std::getline(ply, line) && line != "end_header") {
    if (line.rfind("element vertex ", 0) == 0) announced = std::stoul(line.substr(15));
  }
  while (ply >> line) {
    double x = std::stod(line), y = 0, z = 0, confidence = 0, edge = 0;
    int r = 0, g = 0, b = 0, label = 0;
    REQUIRE(static_cast<bool>(ply >> y >> z >> r >> g >> b >> label >> confidence >> edge));
    ++vertices;
    const auto* node = tree.search(x, y, z);
    REQUIRE(node != nullptr);
    CHECK(node->label() == label);
    CHECK(tree.isNodeOccupied(node));
  }
  CHECK(announced == occupied);
  CHECK(vertices == occupied);
  CHECK_THROWS_AS(export_map(tree, folder.path / "x.stl"), UsageError);
  CHECK_THROWS_AS(export_map(tree, folder.path / "no" / "x.ply"), InputError);
}

TEST_CASE(
    "whatever bit of a map is flipped, it is refused; one without a check sum is read, and that is said") {
  const test::TemporaryFolder folder;
  const fs::path file = folder.path / "map.sot";
  MapClasses classes;
  REQUIRE(classes.set(4, "pallet"));
  const SemanticOcTree tree = room(0.3);
  save_map(tree, file, classes);
  const std::string whole = read(file);
  std::string note;
  CHECK(*load_map(file, &note) == tree);
  CHECK(note.empty());
  const auto refused = [&](std::size_t at, unsigned bit) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(static_cast<unsigned char>(damaged[at]) ^ (1U << bit));
    std::ofstream(file, std::ios::binary) << damaged;
    return refusal(file) != "accepted";
  };
  test::Rng rng("flipped bits of a map");
  for (int k = 0; k < 80; ++k) {
    const auto at = static_cast<std::size_t>(rng.uniform(0, static_cast<double>(whole.size()) - 0.5));
    const auto bit = static_cast<unsigned>(rng.uniform(0, 7.99));
    CAPTURE(at);
    CAPTURE(bit);
    CHECK(refused(at, bit));
  }
  // Every bit of the header, which has the names of the classes, and of the check sum itself.
  const std::size_t data = whole.find("\ndata\n") + 6;
  for (std::size_t at = 0; at < whole.size(); at = at == data ? whole.size() - 16 : at + 1) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      CAPTURE(at);
      CAPTURE(bit);
      CHECK(refused(at, bit));
    }
  }
  CHECK_THROWS_AS((void)load_map_classes(file), InputError);
  std::ofstream(file, std::ios::binary) << whole.substr(0, whole.size() - 16);  // as dynslam 0.1.0 wrote it
  CHECK(*load_map(file, &note) == tree);
  CHECK(note.find("map.sot: has no check sum") != std::string::npos);
  CHECK(load_map_classes(file).name(4) == "pallet");
}

TEST_CASE("a map under its earlier name is read, found in its folder, and exported under the new one") {
  const test::TemporaryFolder folder;
  const SemanticOcTree tree = room(0.3);
  const fs::path now = folder.path / "map.sot", then = folder.path / "map.ot";
  CHECK(map_file_in(folder.path) == now);
  save_map(tree, then);
  CHECK(is_semantic_map(then));
  CHECK(map_file_in(folder.path) == then);
  CHECK(*load_map(then) == tree);
  export_map(*load_map(then), now);
  CHECK(read(now) == read(then));
  CHECK(map_file_in(folder.path) == now);
  fs::remove(then);
  CHECK(refusal(then).find("map.sot beside it does") != std::string::npos);
  export_map(tree, then);  // for octovis
  CHECK_FALSE(is_semantic_map(then));
  CHECK_FALSE(is_semantic_map(folder.path));
  CHECK_FALSE(is_semantic_map(folder.path / "absent"));
}

TEST_CASE("the summary counts what the tree holds") {
  const SemanticOcTree tree = room(0.1);
  const MapSummary s = summarize(tree);
  SemanticOcTree expanded(tree);
  expanded.expand();
  std::size_t occupied = 0, free = 0, chairs = 0;
  for (auto it = expanded.begin_leafs(), end = expanded.end_leafs(); it != end; ++it) {
    const bool full = expanded.isNodeOccupied(*it);
    occupied += full ? 1 : 0;
    free += full ? 0 : 1;
    chairs += full && it->label() == 2 ? 1 : 0;
  }
  CHECK(s.occupied == occupied);
  CHECK(s.free == free);
  CHECK(s.occupied_of_label[2] == chairs);
  CHECK(s.volume(s.occupied) == doctest::Approx(1e-3 * static_cast<double>(occupied)));
  CHECK(s.low[0] >= -2.2);
  CHECK(s.high[0] <= 2.2);
  CHECK(to_text(s).find("chair") != std::string::npos);
  CHECK(to_json(s)["classes"]["chair"]["voxels"] == chairs);
  CHECK(summarize(SemanticOcTree(0.1)).occupied == 0);
}

TEST_CASE("files that are no map, cut short or changed are refused in one line") {
  const test::TemporaryFolder folder;
  const fs::path good = folder.path / "good.sot", bad = folder.path / "bad.sot";
  const SemanticOcTree tree = room(0.3);
  save_map(tree, good);
  CHECK(refusal(good) == "accepted");
  CHECK(refusal(folder.path / "absent.sot").find("does not exist") != std::string::npos);
  CHECK(refusal(folder.path).find("is a folder") != std::string::npos);
  export_map(tree, folder.path / "c.ot");
  CHECK(refusal(folder.path / "c.ot").find("ColorOcTree") != std::string::npos);
  export_map(tree, folder.path / "b.bt");
  CHECK(refusal(folder.path / "b.bt").find(".bt") != std::string::npos);
  test::write_file(bad, std::string(10000, 'x'));
  CHECK(refusal(bad).find("is not an OctoMap file") != std::string::npos);
  test::write_file(bad, "");
  CHECK(refusal(bad).find("is not an OctoMap file") != std::string::npos);
  for (const char* header :
       {"id SemanticOcTree\nsize 5\nres nan\ndata\n", "id SemanticOcTree\nsize 5\nres -1\ndata\n",
        "id SemanticOcTree\nsize 5\nres 0.1\n", "size 5\nres 0.1\ndata\n",
        "id SemanticOcTree\nsize 99999999999999999999999\nres 0.1\ndata\n"}) {
    test::write_file(bad, std::string("# Octomap OcTree file\n") + header);
    CHECK(refusal(bad).rfind(bad.string() + ": ", 0) == 0);
  }

  std::string whole = read(good);
  whole.resize(whole.size() - 16);  // without its check sum, by which whatever is changed is refused
  test::write_file(bad, whole + "x");
  CHECK(refusal(bad).find("after its end") != std::string::npos);
  for (std::size_t n = 0; n < whole.size(); n += 1 + n / 20) {
    test::write_file(bad, whole.substr(0, n));
    CHECK(refusal(bad) != "accepted");
  }
  // Changed bytes: a file is refused, or read as another valid map; never a crash, and every reason is one
  // line.
  test::Rng rng("map fuzz");
  INFO("seed ", rng.seed());
  int refused = 0;
  for (int k = 0; k < 500; ++k) {
    std::string changed = whole;
    for (int i = 0; i < 4; ++i) {
      changed[static_cast<std::size_t>(rng.integer(0, static_cast<int>(changed.size()) - 1))] =
          static_cast<char>(rng.integer(0, 255));
    }
    test::write_file(bad, changed);
    const std::string reason = refusal(bad);
    refused += reason != "accepted" ? 1 : 0;
    CHECK(reason.find('\n') == std::string::npos);
  }
  CHECK(refused > 100);
}

TEST_CASE("pictures of a map: class colours, and height from blue to red") {
  SemanticOcTree tree(0.1);
  ScanVoxels scan(tree.grid());
  for (int i = 0; i < 40; ++i) {  // a pole along y at 2 m, its upper half (negative y) a chair
    const float y = 0.1F * static_cast<float>(i - 20) + 0.05F;
    scan.add_end(Eigen::Vector3f(0.05F, y, 2.05F), y < 0 ? 2 : 0, {0, 255, 0});
  }
  scan.finish();
  tree.integrate(scan);
  MapView view;
  view.size = {200, 300};
  view.focal = 100;
  const auto dominant = [](const cv::Mat& image, int v) {
    const auto p = image.at<cv::Vec3b>(v, 103);
    return p[0] > p[1] && p[0] > p[2] ? 'b' : p[1] > p[2] ? 'g' : 'r';
  };
  const cv::Mat classes = render_map(tree, view);
  CHECK(classes.size() == view.size);
  CHECK(dominant(classes, 100) == 'r');
  CHECK(dominant(classes, 200) == 'g');
  const cv::Mat height = render_map(tree, view, MapColours::height);
  CHECK(dominant(height, 60) == 'r');
  CHECK(dominant(height, 240) == 'b');
  const MapView fitted = fit_view(tree, view_behind(SE3<double>()));
  CHECK(cv::norm(render_map(tree, fitted), render_map(SemanticOcTree(0.1), fitted)) > 0);
}
