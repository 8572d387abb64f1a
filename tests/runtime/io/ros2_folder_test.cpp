// SPDX-License-Identifier: BSD-3-Clause
// Folders of rosbag2: split, compressed, or left by a recorder that was not closed.
#include <doctest/doctest.h>

#include <filesystem>

#include "error_text.hpp"
#include "io/bag/bag_chunk.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/ros2_recording.hpp"
#include "ros2_fixture.hpp"
#include "run_fixture.hpp"

namespace {

using namespace dynslam;
using test::error_of, test::McapWriter, test::mentions, test::small_recording, test::TemporaryFolder,
    test::Wire, test::write_file;
namespace bag = runtime::bag;
namespace fs = std::filesystem;

std::string part(int first, int end) {
  return small_recording<McapWriter>(Wire::cdr_little, first, end).bytes();
}

std::string metadata_of(const std::vector<std::string>& files) {
  std::string text =
      "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths:\n";
  for (const std::string& file : files) text += "    - " + file + "\n";
  return text + "  duration:\n    nanoseconds: 1\n  files:\n    - path: other.mcap\n";
}

/// Times of the colour images, in tenths of a second, as they come.
std::string times_in(const fs::path& path, std::vector<std::string>* missing = nullptr) {
  const bag::BagSurvey found = bag::survey(*bag::open_ros2(path));
  if (missing != nullptr) *missing = found.missing;
  std::string times;
  for (const bag::Shot& shot : found.images.at(0).shots)
    times += std::to_string(shot.stamp / 100000000U) + " ";
  return times;
}

std::string ros2_error(const fs::path& path) {
  return error_of([&] { (void)times_in(path); });
}

}  // namespace

TEST_CASE("a recording in several files is read in the order of metadata.yaml") {
  const TemporaryFolder folder;
  write_file(folder.path / "r_0.mcap", part(1, 3));
  write_file(folder.path / "r_1.mcap", part(3, 4));
  write_file(folder.path / "r_2.mcap", part(4, 6));
  write_file(folder.path / "metadata.yaml", metadata_of({"r_0.mcap", "'r_1.mcap'", "\"old/r_2.mcap\""}));
  CHECK(bag::is_ros2(folder.path));
  std::vector<std::string> missing;
  CHECK(times_in(folder.path, &missing) == "1 2 3 4 5 ");
  CHECK(missing.empty());
  // Images are read from the file that they are in.
  const auto recording = bag::open_ros2(folder.path);
  const bag::BagSurvey found = bag::survey(*recording);
  for (const bag::Shot& shot : found.images.at(0).shots)
    CHECK(bag::nanoseconds(
              bag::parse_image(recording->read(shot.place), "m", bag::Serialisation::cdr).header) ==
          shot.stamp);

  write_file(folder.path / "metadata.yaml", metadata_of({"r_0.mcap", "r_1.mcap"}));
  CHECK(times_in(folder.path, &missing) == "1 2 3 4 5 ");
  REQUIRE(missing.size() == 1);
  CHECK(mentions(missing[0], "r_2.mcap: is not in metadata.yaml and is read, too"));
  fs::remove(folder.path / "r_1.mcap");
  CHECK(mentions(ros2_error(folder.path), "metadata.yaml: names the file r_1.mcap, which is not there"));
  write_file(folder.path / "metadata.yaml", metadata_of({}));
  CHECK(mentions(ros2_error(folder.path), "metadata.yaml: names no files"));
}

TEST_CASE("a folder whose recorder was not closed is read by the numbers of its files") {
  const TemporaryFolder folder;
  write_file(folder.path / "r_9.mcap", part(1, 3));
  write_file(folder.path / "r_10.mcap", part(3, 5));
  write_file(folder.path / "r_11.mcap", part(5, 6).substr(0, 3000));
  write_file(folder.path / "r_12.mcap", "");
  CHECK(bag::is_ros2(folder.path));
  std::vector<std::string> missing;
  CHECK(times_in(folder.path, &missing) == "1 2 3 4 ");
  REQUIRE(missing.size() == 3);
  CHECK(mentions(missing[0], "r_12.mcap: is empty"));
  CHECK(mentions(missing[1], "has no metadata.yaml: its recorder was not closed; 3 files are read"));
  CHECK(mentions(missing[2], "r_11.mcap: was not closed, or was cut off"));
  write_file(folder.path / "other_9.mcap", part(1, 2));
  CHECK(mentions(ros2_error(folder.path), "holds several recordings"));
  const TemporaryFolder empty;
  CHECK_FALSE(bag::is_ros2(empty.path));
  write_file(empty.path / "walk.mcap", part(1, 2));  // a file beside others makes no recording of a folder
  CHECK_FALSE(bag::is_ros2(empty.path));
}

#ifdef DYNSLAM_TEST_ZSTD
TEST_CASE("files compressed by zstd are read, and leave nothing behind") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "r_0.mcap.zst";
  // In several frames, as zstd's threads leave them.
  const std::string content = part(1, 6);
  const std::string packed = test::compressed_bytes("zstd", content.substr(0, 30000)) +
                             test::compressed_bytes("zstd", content.substr(30000));
  write_file(file, packed);
  const TemporaryFolder temporary;
  const fs::path usual = fs::temp_directory_path();
  REQUIRE(setenv("TMPDIR", temporary.path.c_str(), 1) == 0);
  CHECK(bag::is_ros2(file));
  CHECK(times_in(file) == "1 2 3 4 5 ");
  std::vector<std::string> missing;
  write_file(folder.path / "metadata.yaml", metadata_of({"r_0.mcap.zst"}));
  CHECK(times_in(folder.path, &missing) == "1 2 3 4 5 ");
  CHECK(missing.empty());

  write_file(file, packed.substr(0, packed.size() - 5));
  CHECK(times_in(file, &missing).starts_with("1 2 "));
  CHECK(mentions(missing.at(0), "r_0.mcap.zst: was cut off: what could be decompressed is read"));
  std::string damaged = packed;
  damaged[packed.size() / 2] ^= 0x55;
  damaged[packed.size() / 2 + 1] ^= 0x55;
  write_file(file, damaged);
  CHECK(mentions(ros2_error(file), "r_0.mcap.zst: "));
  write_file(file, test::compressed_bytes("zstd", "something else"));
  CHECK_FALSE(bag::is_ros2(file));
  CHECK(mentions(ros2_error(file), "is no recording of ROS 2"));
  CHECK(fs::is_empty(temporary.path));
  setenv("TMPDIR", (temporary.path / "none").c_str(), 1);
  write_file(file, packed);
  CHECK(mentions(ros2_error(file), "/none"));
  setenv("TMPDIR", usual.c_str(), 1);
  // Decompressed by hand, it is what metadata.yaml means.
  fs::remove(file);
  write_file(folder.path / "r_0.mcap", part(1, 6));
  CHECK(times_in(folder.path) == "1 2 3 4 5 ");
}

#ifdef DYNSLAM_TEST_SQLITE3
TEST_CASE("a database compressed by zstd is read") {
  const TemporaryFolder folder;
  small_recording<test::Db3Writer>().write(folder.path / "r.db3");
  write_file(folder.path / "r_0.db3.zst", test::compressed_bytes("zstd", test::bytes(folder.path / "r.db3")));
  CHECK(times_in(folder.path / "r_0.db3.zst") == "1 2 3 4 5 ");
}
#endif
#endif
