// SPDX-License-Identifier: BSD-3-Clause
// `dynslam info`: a sound sequence of any format has no warnings; each planted fault is found.
#include "dynslam/runtime/inspect/inspect.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "error_text.hpp"
#include "format_fixtures.hpp"
#include "program.hpp"

namespace {

using namespace dynslam;
using namespace dynslam::runtime;
using test::film, test::FormatFixture, test::mentions;
namespace fs = std::filesystem;

InspectOptions film_options() {
  InspectOptions options;
  options.reading.rate = test::kFilmRate;
  return options;
}

std::string all_of(const SequenceReport& report) {
  std::string text;
  for (const std::string& warning : report.warnings) text += warning + "\n";
  return text;
}

/// Writes every depth image anew.
void change_depth(const FormatFixture& fixture,
                  const std::function<cv::Mat(std::size_t, const cv::Mat&)>& change) {
  for (std::size_t i = 0; i < film().size(); ++i)
    write_image(fixture.root / "depth" / (FormatFixture::stamp(i) + ".png"), change(i, film()[i].depth));
}

void write_lists(const FormatFixture& fixture, const std::function<bool(std::size_t)>& keep,
                 double depth_offset) {
  fs::remove(fixture.root / "associations.txt");
  std::ofstream rgb(fixture.root / "rgb.txt"), depth(fixture.root / "depth.txt");
  for (std::size_t i = 0; i < film().size(); ++i) {
    if (!keep(i)) continue;
    rgb << FormatFixture::stamp(i) << " rgb/" << FormatFixture::stamp(i) << ".png\n";
    depth << fmt::format("{:.6f}", std::stod(FormatFixture::stamp(i)) + depth_offset) << " depth/"
          << FormatFixture::stamp(i) << ".png\n";
  }
}

}  // namespace

TEST_CASE("a sound sequence of any format has no warnings, and the command is the one to run") {
  for (const char* name : test::kFormatNames) {
    CAPTURE(name);
    const FormatFixture fixture(name);
    if (name == std::string("bonn")) {  // the film has no lens distortion
      std::ofstream(fixture.root / "camera.txt") << "width = 640\nheight = 480\nfx = 542.822841\nfy = "
                                                    "542.576870\ncx = 315.593520\ncy = 237.756098\n";
    }
    const SequenceReport report = inspect_sequence(fixture.root, film_options());
    CHECK(all_of(report) == "");
    CHECK(report.stamps.pairs == film().size());
    CHECK(report.stamps.colour_rate == doctest::Approx(test::kFilmRate));
    CHECK(report.edges.measured);
    CHECK(report.truth.covered == 1);
    CHECK(report.truth.agreeing == report.truth.motions);
    REQUIRE(report.truth.scale);
    CHECK(*report.truth.scale == doctest::Approx(1).epsilon(0.1));
    CHECK(report.command == "dynslam run " + fixture.root.string() + (fixture.stamped() ? "" : " --rate 10"));
    const std::string text = to_text(report);
    CHECK(mentions(text, "format    " + fixture.format));
    CHECK(mentions(text, "warnings  none"));
  }
}

TEST_CASE("each planted fault is found, and nothing else") {
  const FormatFixture fixture("tum");
  const auto found = [&] { return inspect_sequence(fixture.root, film_options()); };
  SUBCASE("wrong depth scale") {
    change_depth(fixture, [](std::size_t, const cv::Mat& depth) -> cv::Mat { return depth / 5; });
    const SequenceReport report = found();
    CHECK(report.warnings.size() == 1);
    CHECK(mentions(all_of(report), "depth units per metre, not 5000"));
    REQUIRE(report.truth.scale);
    CHECK(*report.truth.scale == doctest::Approx(5).epsilon(0.1));
  }
  SUBCASE("depth of micrometres, without ground truth") {
    fs::remove(fixture.root / "groundtruth.txt");
    change_depth(fixture, [](std::size_t, const cv::Mat& depth) -> cv::Mat { return depth / 50; });
    CHECK(mentions(all_of(found()), "half of the depth is below"));
  }
  SUBCASE("depth not registered") {
    change_depth(fixture, [](std::size_t, const cv::Mat& depth) {
      cv::Mat moved = cv::Mat::zeros(depth.size(), depth.type());
      depth(cv::Rect(0, 0, 624, 474)).copyTo(moved(cv::Rect(16, 6, 624, 474)));
      return moved;
    });
    const SequenceReport report = found();
    CHECK(mentions(all_of(report), "depth is not registered to colour"));
    CHECK(report.edges.shift_x == doctest::Approx(-16).epsilon(0.15));
    CHECK(report.edges.shift_y == doctest::Approx(-6).epsilon(0.4));
  }
  SUBCASE("depth that comes two frames late") {
    change_depth(fixture, [](std::size_t i, const cv::Mat&) { return film()[i < 2 ? 0 : i - 2].depth; });
    const SequenceReport report = found();
    CHECK(mentions(all_of(report), "frames late ("));
    CHECK(report.edges.lag == 2);
    CHECK(report.edges.late == doctest::Approx(2).epsilon(0.15));
  }
  SUBCASE("stamps that differ by a constant") {
    // fr3 by name, whose depth is known to be stamped late; of this camera nothing is known.
    std::ofstream(fixture.root / "camera.txt")
        << "width = 640\nheight = 480\nfx = 535.4\nfy = 539.2\ncx = 320.1\ncy = 247.6\n";
    write_lists(
        fixture, [](std::size_t) { return true; }, 0.035);
    InspectOptions options = film_options();
    options.reading.max_association_difference = 0.05;
    CHECK(mentions(all_of(inspect_sequence(fixture.root, options)),
                   "depth stamps are 35.0 ms after those of colour throughout"));
  }
  SUBCASE("a gap") {
    write_lists(
        fixture, [](std::size_t i) { return i < 5 || i > 7; }, 0);
    const SequenceReport report = found();
    CHECK(report.warnings.size() == 1);
    CHECK(mentions(all_of(report), "1 gap: 3 frames are missing; the longest is 0.400 s, 0.400 s after"));
  }
  SUBCASE("images of another size") {
    const std::string name = FormatFixture::stamp(4) + ".png";
    cv::Mat half;
    cv::resize(film()[4].bgr, half, {320, 240});
    write_image(fixture.root / "rgb" / name, half);
    CHECK(mentions(all_of(found()), "1 of 14 colour images are not 640x480 as the camera's, the first"));
    CHECK(mentions(all_of(found()), name + " (320x240)"));
  }
  SUBCASE("a missing image") {
    fs::remove(fixture.root / "depth" / (FormatFixture::stamp(13) + ".png"));
    CHECK(mentions(all_of(found()), "1 of 14 depth images are missing"));
  }
  SUBCASE("a picture that is the one before") {
    const auto path = [&](std::size_t i) {
      return fixture.root / "rgb" / (FormatFixture::stamp(i) + ".png");
    };
    fs::copy_file(path(6), path(7), fs::copy_options::overwrite_existing);
    CHECK(mentions(all_of(found()),
                   "1 colour and 0 depth images are the one before once more, first at 100.7"));
  }
  SUBCASE("a camera that contradicts the folder's name") {
    std::ofstream(fixture.root / "camera.txt")
        << "name = mine\nwidth = 640\nheight = 480\nfx = 600\nfy = 600\ncx = 320\ncy = 240\n";
    CHECK(mentions(all_of(found()), "the folder's name speaks of fr3 (fx 535.4, fy 539.2), the camera mine"));
  }
  SUBCASE("a camera with another lens or unit than the folder's name says") {
    std::ofstream(fixture.root / "camera.txt")
        << "name = mine\nwidth = 640\nheight = 480\nfx = 535.4\nfy = 539.2\ncx = 320.1\ncy = 247.6\n"
           "k1 = 0.1\ndepth_units_per_metre = 1000\n";
    const std::string said = all_of(found());
    CHECK(mentions(said, "the folder's name speaks of fr3, whose centre or lens puts pixels up to "));
    CHECK(mentions(said, " px beside those of the camera mine"));
    CHECK(mentions(said,
                   "the folder's name speaks of fr3 (5000 depth units per metre), the camera mine has 1000"));
  }
  SUBCASE("a camera of another size than the images") {
    std::ofstream(fixture.root / "camera.txt")
        << "width = 320\nheight = 240\nfx = 267.7\nfy = 269.6\ncx = 160\ncy = 124\n";
    const std::string said = all_of(found());
    CHECK(mentions(said, "14 of 14 colour images are not 320x240 as the camera's, the first"));
    CHECK(mentions(said, "14 of 14 depth images are not 320x240 as the camera's, the first"));
    CHECK(mentions(said, "(640x480)"));
  }
  SUBCASE("a camera whose centre is aside and whose pixels are not square") {
    std::ofstream(fixture.root / "camera.txt")
        << "width = 640\nheight = 480\nfx = 535.4\nfy = 480\ncx = 200\ncy = 247.6\n";
    const std::string said = all_of(found());
    CHECK(mentions(said, "the camera's centre (200.0, 247.6) is far from the middle of 640x480"));
    CHECK(mentions(said, "the camera's fx 535.4 and fy 480.0 differ by 12 %"));
  }
  SUBCASE("a value that means no depth") {
    change_depth(fixture, [](std::size_t, const cv::Mat& depth) {
      cv::Mat marked = depth.clone();
      marked.setTo(65535, depth > 22500);  // beyond 4.5 m
      return marked;
    });
    CHECK(mentions(all_of(found()), "of the depth pixels are 65535"));
  }
  SUBCASE("ground truth of another place") {
    std::ofstream poses(fixture.root / "groundtruth.txt");
    for (std::size_t i = 0; i < film().size(); ++i)
      poses << test::pose_text(FormatFixture::stamp(i), film()[i].T_w_c.inverse());
    poses.close();
    CHECK(mentions(all_of(found()), "measured in the images are not the ground truth's"));
  }
}

TEST_CASE("a sequence without a camera is described, and the camera asked for") {
  const FormatFixture fixture("redwood");
  fs::remove(fixture.root / "camera_intrinsic.json");
  const SequenceReport report = inspect_sequence(fixture.root, film_options());
  CHECK(mentions(all_of(report), "the camera is not known: give --camera"));
  CHECK(report.warnings.size() == 1);
  CHECK(mentions(report.command, " --camera FILE"));
  CHECK(report.edges.measured);
}

TEST_CASE("the info command prints text and JSON, and errors on one line") {
  const FormatFixture fixture("7-scenes");
  const std::string root = fixture.root.string();
  const auto json = nlohmann::json::parse(test::call("info " + root + " --json --rate 10").out);
  CHECK(json["format"] == "7-scenes");
  CHECK(json["pairs"] == film().size());
  CHECK(json["camera"]["invalid_depth"] == 65535);
  CHECK(json["warnings"].empty());
  CHECK(json["command"] == "dynslam run " + root + " --rate 10");
  const auto text = test::call("info " + root + " --rate 10");
  CHECK(text.code == 0);
  CHECK(mentions(text.out, "run       dynslam run " + root + " --rate 10\n"));
  const auto none = test::call("info " + fixture.path.string());
  CHECK(none.code == 1);
  CHECK(mentions(none.out, "is of no known format; it holds sequence/"));
  CHECK(test::call("info " + root + " --format tum").code == 1);
  CHECK(test::call("info " + root + " --format kitti").code == 2);
}

TEST_CASE("eval takes the folder of a run and that of a sequence") {
  const FormatFixture fixture("replica");
  const std::string root = fixture.root.string(), out = (fixture.path / "out").string();
  const auto run = test::call("run " + root + " --out " + out + " --rate 10 --dynamics none --no-map");
  CHECK(run.code == 0);
  CHECK(mentions(run.out, "14 pairs"));
  const auto eval = test::call("eval " + out + " " + root + " --rate 10 --json");
  CHECK(nlohmann::json::parse(eval.out)["pairs"] == 14);
}

TEST_CASE("recorded sequences are described rightly, where they are at hand") {
  const char* data = std::getenv("DYNSLAM_DATA");
  if (data == nullptr || !fs::is_directory(fs::path(data) / "tum")) {
    MESSAGE("skipped: DYNSLAM_DATA names no data");
    return;
  }
  const SequenceReport report =
      inspect_sequence(fs::path(data) / "tum" / "rgbd_dataset_freiburg1_xyz_first200");
  CHECK(report.sequence.format == "tum");
  REQUIRE(report.camera);
  CHECK(report.camera->name == "fr1");
  CHECK(report.stamps.colour_rate == doctest::Approx(30).epsilon(0.1));
  CHECK_FALSE(mentions(all_of(report), "registered"));
  REQUIRE(report.truth.scale);
  CHECK(*report.truth.scale == doctest::Approx(1).epsilon(0.1));
}
