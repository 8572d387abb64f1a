// SPDX-License-Identifier: BSD-3-Clause
// The reader of MCAP files: what stands in one, and what damage does to it.
#include <doctest/doctest.h>

#include <memory>
#include <string>
#include <vector>

#include "error_text.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/bag_topics.hpp"
#include "io/bag/mcap_file.hpp"
#include "random.hpp"
#include "ros2_fixture.hpp"

namespace {

using namespace dynslam;
using test::error_of, test::kSmallFrames, test::McapLayout, test::McapWriter, test::mentions, test::Rng,
    test::Serialised, test::small_recording, test::Wire;
namespace bag = runtime::bag;

bag::McapFile mcap_of(const std::string& content) {
  return bag::McapFile(std::make_unique<bag::MemoryBytes>(
      "x.mcap", std::vector<std::uint8_t>(content.begin(), content.end())));
}

bag::BagSurvey survey_of(const std::string& content) {
  return bag::survey(mcap_of(content));
}

/// Finds everything, and decodes every image.
std::string mcap_error(const std::string& content) {
  return error_of([&] {
    const bag::McapFile file = mcap_of(content);
    for (const bag::ImageTopic& topic : bag::survey(file).images) {
      for (const bag::Shot& shot : topic.shots) {
        const auto bytes = file.read(shot.place);
        if (topic.compressed)
          (void)bag::decode_depth(bag::parse_compressed_image(bytes, "d", topic.serialisation), true, "d");
        else
          (void)bag::decode_colour(bag::parse_image(bytes, "c", topic.serialisation), false, "c");
      }
    }
  });
}

}  // namespace

TEST_CASE("an MCAP file's topics, images, camera and transforms are found, however it is laid out") {
  for (const Wire wire : {Wire::cdr_little, Wire::cdr_big, Wire::ros1}) {
    for (const std::string& compression : test::mcap_compressions()) {
      for (const std::size_t per_chunk : {0U, 1U, 3U, 100U}) {
        for (const bool extras : {true, false}) {
          CAPTURE(compression);
          CAPTURE(per_chunk);
          const McapLayout layout{per_chunk, compression, extras, extras,
                                  wire == Wire::ros1 ? "ros1" : "cdr"};
          const bag::McapFile file = mcap_of(small_recording<McapWriter>(wire).bytes(layout));
          const bag::BagSurvey found = bag::survey(file);
          CHECK(found.missing.empty());
          CHECK(found.pose_fault.empty());
          REQUIRE(found.images.size() == 2);
          CHECK(found.images[0].name == "/c");
          CHECK(found.images[0].shots.size() == kSmallFrames);
          CHECK(found.images[0].shots[4].stamp == 500000000U);
          CHECK(found.images[1].encoding == "16UC1; png compressed");
          CHECK(found.infos.at("/camera_info").info.k[0] == 60);
          REQUIRE(found.tracks.size() == 1);
          CHECK(found.tracks[0].poses.size() == kSmallFrames);
          const auto bytes = file.read(found.images[0].shots[2].place);
          const auto image = bag::parse_image(bytes, "c", found.images[0].serialisation);
          CHECK(bag::decode_colour(image, false, "c").at<cv::Vec3b>(9, 9) == cv::Vec3b(30, 20, 10));
        }
      }
    }
  }
}

TEST_CASE("an MCAP file that was cut off is read as far as it goes, with a line that says so") {
  for (const std::size_t per_chunk : {0U, 2U}) {
    const std::string whole = small_recording<McapWriter>().bytes({per_chunk, "", true, true, "cdr"});
    std::size_t before = 0;
    for (std::size_t size = 8; size < whole.size(); size += 331) {
      CAPTURE(size);
      const bag::BagSurvey found = survey_of(whole.substr(0, size));
      REQUIRE(found.missing.size() == 1);
      CHECK(mentions(found.missing[0], "x.mcap: was "));
      std::size_t images = 0;
      for (const bag::ImageTopic& topic : found.images) images += topic.shots.size();
      CHECK(images >= before);
      before = images;
    }
    CHECK(before == 2 * kSmallFrames);
    // As a file system leaves what was not written.
    const bag::BagSurvey found = survey_of(whole.substr(0, whole.size() / 2) + std::string(20000, '\0'));
    CHECK(mentions(found.missing.at(0), "was not closed, or was cut off: read up to byte"));
  }
  CHECK(mentions(error_of([] {
                   (void)bag::choose_topics(survey_of(small_recording<McapWriter>().bytes().substr(0, 60)),
                                            "");
                 }),
                 "its topics of images: none; x.mcap: was not closed, or was cut off: read up to byte"));
  std::string holed = small_recording<McapWriter>().bytes();
  holed.replace(8, 200, 200, '\0');
  CHECK(mentions(mcap_error(holed), "x.mcap: at byte"));  // which has its end
  CHECK(mentions(mcap_error(""), "x.mcap: is no MCAP file"));
  CHECK(mentions(mcap_error("\x89MCAP1\r\n"), "another version than 0"));
}

TEST_CASE("a chunk whose check sum differs is refused where something of it is needed") {
  for (const std::string& compression : test::mcap_compressions()) {
    CAPTURE(compression);
    std::string file = small_recording<McapWriter>().bytes({1, compression, true, true, "cdr"});
    if (compression.empty())
      file[file.find("rgb8") + 500] ^= 1;  // a pixel
    else
      file[file.find(Serialised().text(compression).bytes()) - 1] ^= 1;  // the sum itself
    CHECK(mentions(mcap_error(file), "is damaged: its check sum differs"));
  }
}

TEST_CASE("chunks that hold nothing of use by the index are not decompressed") {
  for (const bool index : {true, false}) {
    McapLayout layout{1, "", index, true, "cdr"};
    std::string file = small_recording<McapWriter>().bytes(layout);
    const auto hello = file.find("hello");
    REQUIRE(hello != std::string::npos);
    // The record of the message is longer than the chunk.
    file[hello - 4 - 4 - 22 - 8] = '\x7F';
    CHECK(mcap_error(file).empty() == index);
  }
}

TEST_CASE("messages that the index counts and that are not there are missed in a line") {
  std::string file = small_recording<McapWriter>().bytes();
  // A count of /c, whose channel is the first: channel, number.
  const std::string count = Serialised().number(1, 2).number(kSmallFrames, 8).bytes();
  const auto at = file.rfind(count);
  REQUIRE(at != std::string::npos);
  file[at + 2] = 7;
  const bag::BagSurvey found = survey_of(file);
  REQUIRE(found.missing.size() == 1);
  CHECK(found.missing[0] == "x.mcap: 5 of 7 messages of /c are in the file");
  CHECK(found.images.at(0).shots.size() == 5);
}

TEST_CASE("an index that is damaged is not used, and the file is read without it") {
  std::string file = small_recording<McapWriter>().bytes();
  const std::uint64_t footer = file.size() - 8 - 29;
  file.replace(footer + 9, 8, Serialised().number(footer - 5, 8).bytes());
  const bag::BagSurvey found = survey_of(file);
  REQUIRE(found.missing.size() == 1);
  CHECK(mentions(found.missing[0], "its index is damaged and not used"));
  CHECK(found.images.at(0).shots.size() == kSmallFrames);
}

TEST_CASE("messages in encodings that are not read are named where no images are found") {
  McapLayout layout;
  layout.encoding = "protobuf";
  const bag::BagSurvey found = survey_of(small_recording<McapWriter>().bytes(layout));
  CHECK(mentions(
      error_of([&] { (void)bag::choose_topics(found, ""); }),
      "x.mcap: has no topic of colour images that are read; its topics of images: none; it has messages "
      "encoded as protobuf, which are not read"));
}

TEST_CASE("MCAP files with any bytes changed are read or refused, and decoded or refused") {
  Rng rng("damaged mcap");
  for (const std::string& compression : test::mcap_compressions()) {
    const std::string whole = small_recording<McapWriter>().bytes({4, compression, true, false, "cdr"});
    CHECK(mcap_error(whole).empty());
    for (int k = 0; k < 200; ++k) {
      std::string damaged = whole;
      for (int n = rng.integer(1, 6); n > 0; --n)
        damaged[static_cast<std::size_t>(rng.integer(0, static_cast<int>(whole.size()) - 1))] =
            static_cast<char>(k % 2 == 0 ? 0xFF : rng.integer(0, 255));
      CHECK(mcap_error(damaged).find('\n') == std::string::npos);
    }
  }
}

TEST_CASE("chunks and messages that lie about their sizes are refused") {
  const std::string whole = small_recording<McapWriter>().bytes({3, "", false, false, "cdr"});
  // The first chunk's record: 1 + 8 bytes, two times, then its size.
  const std::size_t header = 9 + Serialised().text("ros2").text("test").bytes().size(), chunk = 8 + header;
  REQUIRE(whole[chunk] == 6);
  std::string file = whole;
  file[chunk + 9 + 16 + 2] = '\x7F';
  CHECK(mentions(mcap_error(file), "that says it has"));
  file = whole;
  file[chunk + 9 + 16 + 8 + 4] = '\x7F';
  CHECK(mentions(mcap_error(file), "a compression with a name of 127 bytes"));
  file = whole;
  file[chunk + 9 + 16 + 8 + 4 + 4] ^= 1;
  CHECK(mentions(mcap_error(file), "a chunk of"));
#ifdef DYNSLAM_TEST_ZSTD
  file = small_recording<McapWriter>().bytes({3, "zstd", false, false, "cdr"});
  file[chunk + 9 + 16 + 3] = '\x20';  // 512 MB and more
  CHECK(mentions(mcap_error(file), "at most 536870912 are read"));
  file = small_recording<McapWriter>().bytes({3, "zstd", false, false, "cdr"});
  file[chunk + 9 + 16] ^= 1;
  CHECK(mentions(mcap_error(file), "its zstd data cannot be decompressed"));
#endif
  file = small_recording<McapWriter>().bytes({3, "", false, false, "cdr"});
  CHECK(mcap_error(file).empty());
}
