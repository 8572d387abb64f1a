// SPDX-License-Identifier: BSD-3-Clause
// The reader of rosbag2's databases, against databases made by SQLite.
#include <doctest/doctest.h>

#include "error_text.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/db3_file.hpp"
#include "io/bag/ros2_recording.hpp"
#include "random.hpp"
#include "ros2_fixture.hpp"
#include "run_fixture.hpp"

#ifdef DYNSLAM_TEST_SQLITE3

namespace {

using namespace dynslam;
using test::bytes, test::Db3Writer, test::error_of, test::kSmallFrames, test::mentions, test::small_recording,
    test::TemporaryFolder, test::Wire;
namespace bag = runtime::bag;
namespace fs = std::filesystem;

bag::BagSurvey survey_of_db3(const fs::path& file) {
  return bag::survey(bag::Db3File(file, "x.db3"));
}

std::string db3_error(const fs::path& file) {
  return error_of([&] {
    const bag::Db3File database(file, "x.db3");
    for (const bag::ImageTopic& topic : bag::survey(database).images) {
      for (const bag::Shot& shot : topic.shots) (void)database.read(shot.place);
    }
  });
}

void execute(const fs::path& file, const std::string& statements) {
  sqlite3* database = nullptr;
  REQUIRE(sqlite3_open(file.c_str(), &database) == SQLITE_OK);
  CAPTURE(sqlite3_errmsg(database));
  CHECK(sqlite3_exec(database, statements.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK);
  sqlite3_close(database);
}

}  // namespace

TEST_CASE("a database's topics, images, camera and transforms are found") {
  const TemporaryFolder folder;
  for (const Wire wire : {Wire::cdr_little, Wire::cdr_big}) {
    const fs::path path = folder.path / (wire == Wire::cdr_little ? "a#b%20?.db3" : "b.db3");
    small_recording<Db3Writer>(wire).write(path);
    const bag::Db3File file(path, "x.db3");
    const bag::BagSurvey found = bag::survey(file);
    CHECK(found.missing.empty());
    REQUIRE(found.images.size() == 2);
    CHECK(found.images[0].name == "/c");
    CHECK(found.images[0].shots.size() == kSmallFrames);
    CHECK(found.images[1].encoding == "16UC1; png compressed");
    CHECK(found.infos.at("/camera_info").info.k[0] == 60);
    CHECK(found.tracks.at(0).poses.size() == kSmallFrames);
    const auto image = file.read(found.images[0].shots[2].place);
    CHECK(bag::decode_colour(bag::parse_image(image, "c", bag::Serialisation::cdr), false, "c")
              .at<cv::Vec3b>(9, 9) == cv::Vec3b(30, 20, 10));
  }
  for (const auto& entry : fs::directory_iterator(folder.path)) CHECK(entry.path().extension() == ".db3");
}

TEST_CASE("a database that was cut off is read as far as it goes, with a line that says so") {
  const TemporaryFolder folder;
  const fs::path whole = folder.path / "whole.db3", part = folder.path / "part.db3";
  small_recording<Db3Writer>().write(whole, "PRAGMA page_size = 1024");
  const std::string content = bytes(whole);
  std::size_t before = 0, refused = 0;
  for (std::size_t size = 100; size < content.size(); size += 1999) {
    CAPTURE(size);
    test::write_file(part, content.substr(0, size));
    bag::BagSurvey found;
    const std::string error = error_of([&] { found = survey_of_db3(part); });
    if (!error.empty()) {  // the tables themselves are missing
      CHECK(mentions(error, "x.db3: "));
      CHECK(before == 0);
      ++refused;
      continue;
    }
    REQUIRE(found.missing.size() == 1);
    CHECK(mentions(found.missing[0], "x.db3: was cut off: "));
    std::size_t images = 0;
    for (const bag::ImageTopic& topic : found.images) images += topic.shots.size();
    CHECK(images >= before);
    before = images;
    CHECK(db3_error(part).empty());
  }
  CHECK(before > kSmallFrames);
  CHECK(refused < 10);
}

TEST_CASE("a database whose recorder was killed is read with its journal") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "open.db3";
  small_recording<Db3Writer>().write(file, "PRAGMA journal_mode = WAL");
  sqlite3* recorder = nullptr;  // adds a message and does not close
  REQUIRE(sqlite3_open(file.c_str(), &recorder) == SQLITE_OK);
  REQUIRE(sqlite3_exec(recorder, "INSERT INTO messages SELECT 1000, topic_id, 7, data FROM messages LIMIT 1",
                       nullptr, nullptr, nullptr) == SQLITE_OK);
  const bag::BagSurvey found = survey_of_db3(file);
  CHECK(found.images.at(0).shots.size() == kSmallFrames + 1);
  REQUIRE(found.missing.size() == 1);
  CHECK(mentions(found.missing[0], "x.db3: was not closed; what is in open.db3-wal is read, too"));
  sqlite3_close(recorder);
}

TEST_CASE("databases of others, and ones that lie, are refused in a line") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "x.db3";
  const auto error_after = [&](const std::string& statements) {
    fs::remove(file);
    small_recording<Db3Writer>().write(file);
    execute(file, statements);
    return db3_error(file);
  };
  CHECK(mentions(error_after("DROP TABLE topics"), "is a database of SQLite, but none of rosbag2"));
  CHECK(mentions(error_after("ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS SELECT * FROM m"),
                 "but none of rosbag2"));
  CHECK(mentions(error_after("DELETE FROM topics WHERE id = 2"), "message 2 is of the unknown topic 2"));
  CHECK(mentions(error_after("UPDATE messages SET data = 'text' WHERE id = 3"), "message 3 holds no bytes"));
  CHECK(
      mentions(error_after("UPDATE messages SET data = zeroblob(3) WHERE id = 1"), "x.db3: /c, message 1: "));
  test::write_file(file, std::string("SQLite format 3\0 and no more", 28));
  CHECK(mentions(db3_error(file), "x.db3: SQLite: "));
  CHECK(mentions(db3_error(folder.path / "none.db3"), "cannot be read"));
}

TEST_CASE("databases with any bytes changed are read or refused") {
  const TemporaryFolder folder;
  const fs::path whole = folder.path / "whole.db3";
  small_recording<Db3Writer>().write(whole, "PRAGMA page_size = 512");
  const std::string content = bytes(whole);
  test::Rng rng("damaged db3");
  std::size_t refused = 0;
  for (int k = 0; k < 300; ++k) {
    std::vector<std::uint8_t> damaged(content.begin(), content.end());
    for (int n = rng.integer(1, 30); n > 0; --n)
      damaged[static_cast<std::size_t>(rng.integer(0, static_cast<int>(content.size()) - 1))] =
          static_cast<std::uint8_t>(k % 2 == 0 ? 0xFF : rng.integer(0, 255));
    const std::string error = error_of([&] {
      const bag::Db3File file(std::move(damaged), "x.db3");
      for (const bag::ImageTopic& topic : bag::survey(file).images) {
        for (const bag::Shot& shot : topic.shots) (void)file.read(shot.place);
      }
    });
    CHECK(error.find('\n') == std::string::npos);
    refused += error.empty() ? 0 : 1;
  }
  CHECK(refused > 20);
  CHECK(refused < 290);
}

#ifdef DYNSLAM_TEST_ZSTD
TEST_CASE("messages that were compressed one by one are decompressed") {
  const TemporaryFolder folder;
  const fs::path file = folder.path / "x.db3";
  small_recording<Db3Writer>().write(file, {}, "zstd");
  const auto recording = bag::open_ros2(file);
  const bag::BagSurvey found = bag::survey(*recording);
  REQUIRE(found.images.size() == 2);
  const auto image = recording->read(found.images[0].shots.at(4).place);
  CHECK(bag::decode_colour(bag::parse_image(image, "c", bag::Serialisation::cdr), false, "c")
            .at<cv::Vec3b>(9, 9) == cv::Vec3b(30, 20, 10));
  CHECK(found.tracks.at(0).poses.size() == kSmallFrames);
  execute(file, "UPDATE messages SET data = substr(data, 1, 30) WHERE id = 1");
  CHECK(mentions(error_of([&] { (void)bag::survey(*bag::open_ros2(file)); }),
                 "a message, message 1: is damaged: its zstd data cannot be decompressed"));
}
#endif

#else
TEST_CASE("databases are not read by a build without SQLite: skipped") {
  MESSAGE("skipped: SQLite was not found");
}
#endif
