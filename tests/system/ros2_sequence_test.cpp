// SPDX-License-Identifier: BSD-3-Clause
// Recordings of ROS 2 as sequences: recognised, and the same as a bag of ROS 1 with the same messages.
#include <doctest/doctest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "bag_fixture.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "error_text.hpp"
#include "mcap_writer.hpp"
#include "program.hpp"
#include "run_fixture.hpp"
#ifdef DYNSLAM_TEST_SQLITE3
#include "db3_writer.hpp"
#endif

namespace {

using namespace dynslam;
using namespace dynslam::runtime;
using test::bag_of_film, test::camera_info, test::film, test::FormatFixture, test::metric_depth,
    test::raw_colour, test::TemporaryFolder, test::tf_truth, test::TopicOfFilm, test::call, test::mentions,
    test::ProgramResult, test::McapWriter, test::Wire;
namespace fs = std::filesystem;

std::vector<TopicOfFilm> film_topics(Wire wire) {
  return {raw_colour(test::kColourTopic, wire), metric_depth(test::kDepthTopic, wire), camera_info({}, wire),
          tf_truth(wire)};
}

std::string mcap_of_film(std::size_t first = 0, std::size_t end = 1000) {
  return bag_of_film<McapWriter>(film_topics(Wire::cdr_little), first, end).bytes({});
}

/// What `run` writes.
std::string trajectory_of(const fs::path& sequence, const fs::path& out) {
  RunOptions options;
  options.sequence = sequence;
  options.out = out;
  options.dynamics = DynamicsMode::geometric;
  options.map = false;
  CHECK(run_sequence(options, test::kNeverStop).tracked == film().size());
  return test::bytes(out / "trajectory.txt");
}

/// Of equal times, camera, images and ground truth.
void check_same(const Sequence& a, const Sequence& b) {
  REQUIRE(a.frames.size() == b.frames.size());
  CHECK(a.topics == b.topics);
  CHECK(camera_of(a).model.pinhole().fx() == camera_of(b).model.pinhole().fx());
  REQUIRE(a.groundtruth.size() == b.groundtruth.size());
  for (std::size_t k = 0; k < a.frames.size(); ++k) {
    CHECK(a.frames[k].stamp == b.frames[k].stamp);
    CHECK(a.frames[k].ns == b.frames[k].ns);
    CHECK((a.groundtruth[k].T_w_c.inverse() * b.groundtruth[k].T_w_c).log().norm() < 1e-12);
    const RgbdFrame x = decode_frame(a.frames[k], k, camera_of(a)),
                    y = decode_frame(b.frames[k], k, camera_of(b));
    CHECK(cv::norm(x.bgr, y.bgr, cv::NORM_INF) == 0);
    CHECK(std::equal(x.depth.begin<float>(), x.depth.end<float>(), y.depth.begin<float>(),
                     [](float p, float q) { return p == q || (p != p && q != q); }));
  }
}

}  // namespace

TEST_CASE("MCAP files, databases and folders give the sequence and the trajectory of the same ROS 1 bag") {
  const TemporaryFolder folder;
  const fs::path bag = folder.path / "film.bag";
  test::write_file(bag, bag_of_film(film_topics(Wire::ros1)).bytes());
  const Sequence expected = load_sequence(bag);
  const std::string trajectory = trajectory_of(bag, folder.path / "bag");

  std::vector<fs::path> recordings{folder.path / "film.mcap", folder.path / "split",
                                   folder.path / "ros1.mcap"};
  test::write_file(recordings[0], mcap_of_film());
  fs::create_directories(recordings[1]);
  test::write_file(recordings[1] / "split_0.mcap", mcap_of_film(0, 5));
  test::write_file(recordings[1] / "split_1.mcap", mcap_of_film(5, 1000));
  test::write_file(
      recordings[1] / "metadata.yaml",
      "rosbag2_bagfile_information:\n  relative_file_paths:\n    - split_0.mcap\n    - split_1.mcap\n");
  test::write_file(recordings[2],
                   bag_of_film<McapWriter>(film_topics(Wire::ros1)).bytes({4, "", true, true, "ros1"}));
#ifdef DYNSLAM_TEST_SQLITE3
  recordings.push_back(folder.path / "film.db3");
  bag_of_film<test::Db3Writer>(film_topics(Wire::cdr_big)).write(recordings.back());
#endif
  for (const fs::path& recording : recordings) {
    CAPTURE(recording.string());
    CHECK(formats_of(recording) == std::vector<std::string>{"ros2"});
    const Sequence sequence = load_sequence(recording);
    CHECK(sequence.format == "ros2");
    CHECK(sequence.notes.empty());
    check_same(sequence, expected);
    CHECK(trajectory_of(recording, folder.path / ("out_" + recording.filename().string())) == trajectory);
  }
}

TEST_CASE("what the program says of recordings of ROS 2") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "film.mcap";
  test::write_file(file, mcap_of_film());
  const std::string name = file.string(), out = (folder.path / "out").string();
  const ProgramResult info = call("info " + name);
  CHECK(info.code == 0);
  CHECK(mentions(info.out, "format    ros2\ntopics    /camera/rgb/image_color,/camera/depth/image\n"));
  CHECK(mentions(info.out, "14 pairs of 14 colour and 14 depth images"));
  CHECK(mentions(info.out, "/tf (world -> openni_rgb_optical_frame): 14 poses"));
  CHECK(mentions(info.out, "warnings  none"));
  const ProgramResult run = call("run " + name + " --format ros2 --no-map --out " + out);
  CHECK(run.code == 0);
  CHECK(mentions(run.out, "ATE [m]"));
  CHECK(mentions(call("eval " + out + " " + name).out, "ATE [m]"));
  const ProgramResult convert = call("convert " + name + " " + out + "_tum");
  CHECK(convert.code == 0);
  CHECK(load_sequence(out + "_tum").frames.size() == film().size());

  // An end that is missing is a line, of everything that goes through the images.
  const std::string whole = test::bytes(file);
  test::write_file(file, whole.substr(0, whole.size() * 3 / 4));
  const ProgramResult cut = call("info " + name);
  CHECK(cut.code == 0);
  CHECK(mentions(cut.out, "warnings  " + name + ": was not closed, or was cut off: read up to byte"));
  CHECK(mentions(call("run " + name + " --no-map --dynamics none --out " + out + "2").out,
                 "dynslam: warning: " + name + ": was not closed"));
  CHECK(mentions(call("convert " + name + " " + out + "_tum2").out,
                 "dynslam: warning: " + name + ": was not closed"));

  test::check_one_line_error("info " + name + " --topics /a,/b", 2, "has no topic '/a' of images");
  test::write_file(folder.path / "notes.mcap", "no recording\n");
  test::check_one_line_error("info " + (folder.path / "notes.mcap").string(), 1,
                             "is neither a folder nor a recording of ROS (.bag, .mcap, .db3)");
  test::check_one_line_error("info --format ros2 " + (folder.path / "notes.mcap").string(), 1,
                             "is no recording of ROS 2: neither MCAP nor a database of SQLite");
  test::check_one_line_error("info --format ros2 " + (folder.path / "none.mcap").string(), 1, "none.mcap");
  test::check_one_line_error("info --format ros2 " + FormatFixture("tum").root.string(), 1,
                             "holds no recording of ROS 2");
}

TEST_CASE("a recording of a sequence that TUM named has the camera of that name in the warnings") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "rgbd_dataset_freiburg1_desk.mcap";
  test::write_file(file, mcap_of_film());
  CHECK(
      mentions(call("info " + file.string()).out, "the recording's name speaks of fr1 (fx 517.3, fy 516.5)"));
}
