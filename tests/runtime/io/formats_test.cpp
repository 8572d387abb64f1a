// SPDX-License-Identifier: BSD-3-Clause
// Every format of sequences: recognised, read with its camera, times, depth and ground truth, run, evaluated.
#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "error_text.hpp"
#include "format_fixtures.hpp"

namespace {

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::film, test::FormatFixture, test::mentions, test::TemporaryFolder;
namespace fs = std::filesystem;

SequenceOptions at_film_rate() {
  SequenceOptions options;
  options.rate = test::kFilmRate;
  return options;
}

/// Motion from the first true pose to the k-th.
SE3<double> moved(const SE3<double>& first, const SE3<double>& last) {
  return first.inverse() * last;
}

std::string error_of_loading(const fs::path& root) {
  return error_of([&] { (void)load_sequence(root); });
}

/// The same, or what was left out, in a line.
std::string error_or_note_of_loading(const fs::path& root) {
  Sequence sequence;
  const std::string error = error_of([&] { sequence = load_sequence(root); });
  return error.empty() ? fmt::format("{}", fmt::join(sequence.notes, "; ")) : error;
}

void replace_file(const fs::path& path, const std::string& content) {
  REQUIRE(fs::exists(path));
  std::ofstream(path, std::ios::binary) << content;
}

}  // namespace

TEST_CASE("a folder of each format is recognised, and read with its camera, times, depth and ground truth") {
  for (const char* name : test::kFormatNames) {
    CAPTURE(name);
    const FormatFixture fixture(name);
    CHECK(formats_of(fixture.root) == std::vector<std::string>{fixture.format});
    const Sequence sequence = load_sequence(fixture.root, at_film_rate());
    CHECK(sequence.format == fixture.format);
    CHECK(sequence.has_stamps == fixture.stamped());
    REQUIRE(sequence.frames.size() == film().size());
    for (std::size_t i = 1; i < sequence.frames.size(); ++i)
      CHECK(sequence.frames[i].t_rgb - sequence.frames[i - 1].t_rgb == doctest::Approx(1 / test::kFilmRate));

    const CameraConfig camera = camera_of(sequence);
    CHECK(camera.width == fixture.view.width);
    CHECK(camera.height == fixture.view.height);
    CHECK(camera.model.pinhole().fx() == doctest::Approx(fixture.view.fx));
    CHECK(camera.model.pinhole().fy() == doctest::Approx(fixture.view.fy));
    CHECK(camera.model.pinhole().cx() == doctest::Approx(fixture.view.cx));
    CHECK(camera.model.pinhole().cy() == doctest::Approx(fixture.view.cy));

    // The eleventh frame: by name it may stand between the second and the third.
    const std::size_t k = 10;
    const RgbdFrame frame = decode_frame(sequence.frames[k], k, camera);
    const test::Shot expected = fixture.shot(k);
    CHECK(cv::norm(frame.bgr, expected.bgr, cv::NORM_L1) / double(3 * expected.bgr.total()) < 6);
    std::size_t valid = 0, right = 0;
    for (int v = 0; v < frame.depth.rows; ++v) {
      for (int u = 0; u < frame.depth.cols; ++u) {
        const int raw = expected.depth.at<std::uint16_t>(v, u);
        const float z = frame.depth.at<float>(v, u);
        valid += raw != 0 && raw != fixture.view.none ? 1 : 0;
        right += raw != 0 && raw != fixture.view.none && std::abs(z - float(raw / fixture.view.units)) < 1e-4F
                     ? 1
                     : 0;
        if (raw == 0 || raw == fixture.view.none) CHECK_FALSE(z > 0);
      }
    }
    CHECK(valid > frame.depth.total() / 4);
    CHECK(right == valid);

    REQUIRE(sequence.groundtruth.size() == film().size());
    const SE3<double> truth = moved(sequence.groundtruth.front().T_w_c, sequence.groundtruth.back().T_w_c);
    const SE3<double> filmed = moved(film().front().T_w_c, film().back().T_w_c);
    CHECK((truth.inverse() * filmed).log().norm() < 1e-6);
  }
}

TEST_CASE("a sequence of each format is tracked, and evaluated against its own ground truth") {
  for (const char* name : test::kFormatNames) {
    CAPTURE(name);
    const FormatFixture fixture(name);
    const TemporaryFolder out;
    RunOptions options;
    options.sequence = fixture.root;
    options.out = out.path;
    options.dynamics = DynamicsMode::none;
    options.map = false;
    options.rate = test::kFilmRate;
    if (name == std::string("bonn")) {
      // The film has no lens distortion, Bonn's camera has.
      std::ofstream(fixture.root / "camera.txt") << "width = 640\nheight = 480\nfx = 542.822841\nfy = "
                                                    "542.576870\ncx = 315.593520\ncy = 237.756098\n";
    }
    const std::atomic<bool> never{false};
    const RunSummary summary = run_sequence(options, never);
    CHECK(summary.tracked == film().size());
    const TrajectoryReport report = evaluate_trajectory(out.path, fixture.root, at_film_rate());
    CHECK(report.ate.pairs == film().size());
    CHECK(report.ate.translation.rmse < 0.03);
    if (name == std::string("icl-nuim")) {
      // As it stands in the file, y up, no rotation lays it on the trajectory: the test above can fail.
      auto mirrored = read_trajectory(fixture.root / "livingRoom1.gt.freiburg");
      for (auto& pose : mirrored) pose.t /= test::kFilmRate;
      const auto wrong = absolute_trajectory_error<double>(summary.trajectory, mirrored);
      REQUIRE(wrong);
      CHECK(wrong->translation.rmse > 2 * report.ate.translation.rmse);
    }
  }
}

TEST_CASE("a folder of no format or of two is one clear error, and --format decides") {
  const FormatFixture fixture("redwood");
  std::ofstream(fixture.root / "frame-000000.color.png") << "";
  std::ofstream(fixture.root / "frame-000000.depth.png") << "";
  const std::string both = error_of_loading(fixture.root);
  CHECK(mentions(both, "7-scenes (frame-NNNNNN.color.png"));
  CHECK(mentions(both, "redwood (color/"));
  CHECK(mentions(both, "--format NAME"));
  SequenceOptions forced;
  forced.format = "redwood";
  CHECK(load_sequence(fixture.root, forced).frames.size() == film().size());
  forced.format = "kitti";
  CHECK_THROWS_AS((void)load_sequence(fixture.root, forced), UsageError);

  const TemporaryFolder other;
  std::ofstream(other.path / "notes.md") << "";
  fs::create_directories(other.path / "bags");
  const std::string none = error_of_loading(other.path);
  CHECK(mentions(none, "is of no known format; it holds bags/, notes.md"));
  CHECK(mentions(none, "--format tum|bonn|eth3d"));
}

TEST_CASE("images without a partner are left out and counted; times come from numbers") {
  const FormatFixture fixture("scannet");
  fs::remove(fixture.root / "depth" / "3.png");
  fs::remove(fixture.root / "color" / "5.jpg");
  const Sequence sequence = load_sequence(fixture.root, at_film_rate());
  CHECK(sequence.frames.size() == film().size() - 2);
  CHECK(sequence.colour_times.size() == film().size() - 1);
  CHECK(sequence.depth_times.size() == film().size() - 1);
  CHECK(sequence.frames[3].stamp == "4");
  CHECK(sequence.frames[3].t_rgb == doctest::Approx(0.4));
  // Unknown poses are left out, as ScanNet writes them where it lost the camera.
  replace_file(fixture.root / "pose" / "0.txt",
               "-inf -inf -inf -inf\n-inf -inf -inf -inf\n"
               "-inf -inf -inf -inf\n-inf -inf -inf -inf\n");
  CHECK(load_sequence(fixture.root).groundtruth.size() == film().size() - 1);
}

TEST_CASE("depth_time_offset says when the depth of each format was taken, also of images without stamps") {
  for (const char* name : test::kFormatNames) {
    CAPTURE(name);
    const FormatFixture fixture(name);
    const Sequence at_once = load_sequence(fixture.root, at_film_rate());
    SequenceOptions options = at_film_rate();
    options.depth_time_offset = 0.005;
    const Sequence late = load_sequence(fixture.root, options);
    REQUIRE(late.frames.size() == at_once.frames.size());
    REQUIRE(late.depth_times.size() == at_once.depth_times.size());
    for (std::size_t i = 0; i < late.frames.size(); ++i) {
      CHECK(late.frames[i].t_rgb == at_once.frames[i].t_rgb);
      CHECK(late.frames[i].t_depth == doctest::Approx(late.frames[i].t_rgb - 0.005));  // stamped alike
      CHECK(late.depth_times[i] == doctest::Approx(late.frames[i].t_rgb - 0.005));
    }
  }
}

TEST_CASE("Redwood's names with microseconds are times, and pair by them") {
  const TemporaryFolder folder;
  for (const char* name : {"rgb", "depth"}) fs::create_directories(folder.path / name);
  for (int i = 1; i <= 3; ++i) {
    std::ofstream(folder.path / "rgb" / fmt::format("{:07}-{:012}.jpg", i, 33333 * i)) << "";
    std::ofstream(folder.path / "depth" / fmt::format("{:07}-{:012}.png", i + 7, 33333 * i + 2000)) << "";
  }
  const Sequence sequence = load_sequence(folder.path);
  REQUIRE(sequence.frames.size() == 3);
  CHECK(sequence.has_stamps);
  CHECK(sequence.frames[1].t_rgb == doctest::Approx(0.066666));
  CHECK(sequence.frames[1].t_depth - sequence.frames[1].t_rgb == doctest::Approx(0.002));
  CHECK_THROWS_AS((void)camera_of(sequence), UsageError);  // no camera_intrinsic.json
}

TEST_CASE("a camera.txt in the folder goes before the format's camera, and keeps its invalid value") {
  const FormatFixture fixture("7-scenes");
  std::ofstream(fixture.root / "camera.txt") << "width = 640\nheight = 480\nfx = 525\nfy = 525\ncx = "
                                                "319.5\ncy = 239.5\ndepth_units_per_metre = 1000\n";
  const CameraConfig camera = camera_of(load_sequence(fixture.root));
  CHECK(camera.model.pinhole().fx() == 525);
  CHECK(camera.invalid_depth == 65535);
}

TEST_CASE(
    "damaged files of each format are refused, or left out where they can be, with file, line and reason") {
  struct Damage {
    const char* format;
    const char* file;
    const char* content;
    const char* message;
  };
  const std::string not_rigid = "1 0 0 0\n0 1 0 0\n0 0 5 0\n0 0 0 1\n";
  const Damage damages[] = {
      {"tum", "associations.txt", "1 rgb/1.png 1\n", "associations.txt:1: expected 4 columns"},
      {"tum", "associations.txt", "2 rgb/2.png 2 depth/2.png\n1 depth/1.png 1 rgb/1.png\n",
       "associations.txt: the lines are not sorted by time"},
      {"eth3d", "calibration.txt", "535 535 300\n", "calibration.txt:1: expected 4 numbers (fx fy cx cy)"},
      {"eth3d", "calibration.txt", "535 535 300 abc\n", "calibration.txt:1: 'abc' is not a finite number"},
      {"eth3d", "calibration.txt", "535 -535 300 220\n", "calibration.txt: fx and fy must be positive"},
      {"icl-nuim", "associations.txt", "1.5 depth/1.png 1.5 rgb/1.png\n",
       "associations.txt: '1.5' is not the number of a frame"},
      {"icl-nuim", "livingRoom1.gt.freiburg", "1 0 0 0\n", "livingRoom1.gt.freiburg:1: expected 8 columns"},
      {"7-scenes", "frame-000004.pose.txt", "1 0 0 0\n0 1 0 x\n",
       "frame-000004.pose.txt:2: 'x' is not a number"},
      {"7-scenes", "frame-000004.pose.txt", "1 0 0 0\n0 1 0 0\n",
       "frame-000004.pose.txt:2: the matrix ends after 2 of 4 rows"},
      {"7-scenes", "frame-000004.pose.txt", not_rigid.c_str(),
       "frame-000004.pose.txt: the matrix is no rigid motion"},
      {"replica", "traj.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0\n", "traj.txt:1: expected 16 numbers, found 15"},
      {"replica", "traj.txt", "\n1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1\n", "traj.txt:2: the matrix is no rigid"},
      {"replica", "../cam_params.json", "{\"camera\": {\"w\": 640,\n\"h\": }}",
       "cam_params.json:2: is not JSON"},
      {"replica", "../cam_params.json", "{\"camera\": {\"w\": 1e999}}", "holds a number that is too large"},
      {"replica", "../cam_params.json", "{\"camera\": {\"w\": 640}}",
       "cam_params.json: the number \"h\" is missing"},
      {"scannet", "intrinsic/intrinsic_depth.txt", "540 0 319.5 0\n",
       "intrinsic_depth.txt:1: the matrix ends after 1 of 4"},
      {"scannet", "intrinsic/intrinsic_color.txt", "1300 0 639.5 0\n0 1300 479.5 0\n0 0 1 0\n0 0 0 1\n",
       "intrinsic_color.txt: scaled to the depth image, it differs by 110 px"},
      {"redwood", "camera_intrinsic.json", "{\"width\": 640, \"height\": 480}",
       "camera_intrinsic.json: \"intrinsic_matrix\" with 9 numbers is missing"},
      {"redwood", "camera_intrinsic.json",
       "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [525,0,319.5,0,525,239.5,0,0,1]}",
       "is not [fx, 0, 0, 0, fy, 0, cx, cy, 1]"},
      {"redwood", "trajectory.log", "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 1 2\n",
       "trajectory.log:6: the matrix ends after 0 of 4 rows"},
      {"redwood", "trajectory.log", "99 99 100\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
       "trajectory.log:1: names frame 99, but there are 14 colour images"},
  };
  std::string made;
  std::unique_ptr<FormatFixture> fixture;
  for (const Damage& damage : damages) {
    CAPTURE(damage.format);
    CAPTURE(damage.message);
    // One folder per format: what one damage replaced is put back.
    if (made != damage.format) fixture = std::make_unique<FormatFixture>(made = damage.format);
    const fs::path file = fixture->root / damage.file;
    const std::string whole = [&] {
      std::ifstream in(file, std::ios::binary);
      return std::string(std::istreambuf_iterator<char>(in), {});
    }();
    replace_file(file, damage.content);
    const std::string error = error_or_note_of_loading(fixture->root);
    CAPTURE(error);
    CHECK(mentions(error, damage.message));
    CHECK(std::count(error.begin(), error.end(), '\n') == 0);
    replace_file(file, whole);
  }
}

TEST_CASE("two files of one number are refused") {
  const FormatFixture fixture("redwood");
  fs::copy_file(fixture.root / "depth" / "00003.png", fixture.root / "depth" / "3.PNG");
  CHECK(mentions(error_of_loading(fixture.root), "have the same number"));
}
