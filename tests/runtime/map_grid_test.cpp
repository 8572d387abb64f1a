// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_grid.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>

#include "dynslam/runtime/error.hpp"
#include "error_text.hpp"
#include "painted_map.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;

namespace {

/// A floor 1.2 m below the camera, ahead of it a wall with a chair to the left and a person to the right; the
/// camera's frame: x right, y down, z ahead.
void paint_camera_map(interop::SemanticOcTree& tree) {
  test::paint_map(tree, {-1.5, -0.8, 0}, {1.5, 1.24, 3}, [](const Eigen::Vector3d& p) -> test::Paint {
    const auto within = [](double x, double low, double high) { return x > low && x < high; };
    if (p.y() > 1.2) return {Occupancy::occupied};
    if (p.z() > 2.8) return {Occupancy::occupied};
    if (within(p.x(), -1.2, -0.8) && within(p.z(), 1.0, 1.4) && p.y() > 0.7) return {Occupancy::occupied, 2};
    if (within(p.x(), 0.6, 1.0) && within(p.z(), 1.6, 2.0) && p.y() > -0.4) return {Occupancy::occupied, 1};
    if (within(p.x(), 0.2, 1.4) && p.z() > 2.2) return {};  // behind the person
    return {Occupancy::free};
  });
}

/// A map as ROS' map_server and Nav2 load it: the state of a point by the image and the rules of trinary
/// mode.
struct ServedMap {
  std::map<std::string, std::string> yaml;
  cv::Mat image;
  double resolution = 0, x = 0, y = 0;

  explicit ServedMap(const std::filesystem::path& file) {
    std::ifstream in(file);
    REQUIRE(in.good());
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with('#')) continue;
      const std::size_t colon = line.find(": ");
      REQUIRE(colon != std::string::npos);
      yaml[line.substr(0, colon)] = line.substr(colon + 2);
    }
    std::string name = yaml["image"];
    REQUIRE(name.size() > 2);
    image = cv::imread((file.parent_path() / name.substr(1, name.size() - 2)).string(), cv::IMREAD_UNCHANGED);
    REQUIRE(image.type() == CV_8UC1);
    resolution = std::stod(yaml["resolution"]);
    REQUIRE(std::sscanf(yaml["origin"].c_str(), "[%lf, %lf, 0]", &x, &y) == 2);
    CHECK(yaml["mode"] == "trinary");
    CHECK(yaml["negate"] == "0");
  }
  /// @param ahead, left  from below the first camera [m]
  [[nodiscard]] Occupancy at(double ahead, double left) const {
    const int column = static_cast<int>(std::floor((ahead - x) / resolution)),
              row = image.rows - 1 - static_cast<int>(std::floor((left - y) / resolution));
    REQUIRE((column >= 0 && column < image.cols && row >= 0 && row < image.rows));
    const double p = (255 - image.at<std::uint8_t>(row, column)) / 255.0;
    if (p > std::stod(yaml.at("occupied_thresh"))) return Occupancy::occupied;
    return p < std::stod(yaml.at("free_thresh")) ? Occupancy::free : Occupancy::unknown;
  }
};

}  // namespace

TEST_CASE("a grid of a map is what map_server reads: states, place and the order of rows") {
  const test::TemporaryFolder folder;
  interop::SemanticOcTree tree(0.05);
  paint_camera_map(tree);
  for (const bool find_floor : {true, false}) {
    CAPTURE(find_floor);
    runtime::MapGridOptions options;
    if (!find_floor) options.camera_height = 1.225;
    const auto grid = runtime::make_map_grid(tree, options, {}, "map.sot");
    CHECK(grid.ground.origin_height == doctest::Approx(1.225).epsilon(0.01));
    runtime::save_map_grid(grid, folder.path / "the map.pgm");
    const ServedMap served(folder.path / "the map.yaml");
    CHECK(served.yaml.at("image") == "\"the map.pgm\"");
    CHECK(served.resolution == 0.05);
    CHECK(served.at(1.2, 1.0) == Occupancy::occupied);  // the chair, on the left
    CHECK(served.at(1.2, -1.0) == Occupancy::free);     // nothing on the right
    CHECK(served.at(2.9, 1.0) == Occupancy::occupied);  // the wall ahead
    CHECK(served.at(0.5, 0.0) == Occupancy::free);
    CHECK(served.at(1.8, -0.8) == Occupancy::unknown);  // a person is no obstacle, and hides what is there
    CHECK(served.at(2.5, -0.8) == Occupancy::unknown);
    CHECK(served.at(2.5, 0.8) == Occupancy::free);
    // The first row is the farthest to the left, the first column the nearest.
    const int chair = static_cast<int>(std::floor((1.2 - served.x) / 0.05));
    int first = 0;
    while (served.image.at<std::uint8_t>(first, chair) != 0) ++first;
    CHECK(first * 0.05 == doctest::Approx(0.3).epsilon(0.06));
    CHECK(served.image.rows * 0.05 == doctest::Approx(3.05).epsilon(0.02));
  }
}

TEST_CASE("classes of a grid's obstacles are the caller's") {
  interop::SemanticOcTree tree(0.05);
  paint_camera_map(tree);
  runtime::MapClasses classes;
  const std::uint8_t pallet = classes.add("pallet");
  const auto state = [&](const runtime::MapGridOptions& options, double ahead, double left) {
    const auto grid = runtime::make_map_grid(tree, options, classes, "map.sot").grid;
    return grid.cells(static_cast<int>((ahead - grid.corner.x()) / grid.cell),
                      static_cast<int>((left - grid.corner.y()) / grid.cell));
  };
  CHECK(pallet > 3);
  CHECK(state({.ignored = {"chair"}}, 1.2, 1.0) != Occupancy::occupied);
  CHECK(state({.ignored = {"chair"}}, 2.9, 1.0) == Occupancy::occupied);
  CHECK(state({.only = {"chair", "pallet"}}, 1.2, 1.0) == Occupancy::occupied);
  CHECK(state({.only = {"chair"}}, 2.9, 1.0) != Occupancy::occupied);
  CHECK(state({.only = {"person"}}, 1.8, -0.8) == Occupancy::unknown);  // never
  CHECK_THROWS_WITH_AS((void)state({.ignored = {"horse"}}, 0, 0), "the map has no class 'horse'",
                       runtime::UsageError);
}

TEST_CASE("a grid that cannot be made says why") {
  interop::SemanticOcTree tree(0.05), empty(0.05);
  paint_camera_map(tree);
  const auto error = [](const interop::SemanticOcTree& map, const runtime::MapGridOptions& options) {
    return test::error_of([&] { (void)runtime::make_map_grid(map, options, {}, "some.sot"); });
  };
  CHECK(test::mentions(error(empty, {}), "some.sot: shows no floor"));
  CHECK(test::mentions(error(empty, {.camera_height = 1}), "some.sot: shows nothing between 0.1 and 1.8 m"));
  CHECK(test::mentions(error(tree, {.grid = {.max_cells = 10}}), "some.sot: is too large for a grid"));
  CHECK_THROWS_AS((void)runtime::make_map_grid(tree, {.up = Eigen::Vector3d::Zero()}, {}, "some.sot"),
                  runtime::UsageError);
  CHECK_THROWS_AS((void)runtime::make_map_grid(tree, {.grid = {.low = 2}}, {}, "some.sot"),
                  runtime::UsageError);
  const auto grid = runtime::make_map_grid(tree, {}, {}, "some.sot");
  CHECK_THROWS_WITH_AS(runtime::save_map_grid(grid, "grid.png"), "'grid.png': a grid's extension is .pgm",
                       runtime::UsageError);
  CHECK(
      test::mentions(test::error_of([&] { runtime::save_map_grid(grid, "/absent/grid.pgm"); }), "grid.pgm"));
}
