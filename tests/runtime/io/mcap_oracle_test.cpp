// SPDX-License-Identifier: BSD-3-Clause
// Against npm's @mcap/core and @foxglove/rosmsg2-serialization: they read the tests' MCAP files, and dynslam
// reads what they write.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>

#include "io/bag/bag_chunk.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/bag_truth.hpp"
#include "io/bag/mcap_file.hpp"
#include "program.hpp"
#include "ros2_fixture.hpp"
#include "run_fixture.hpp"

namespace {

using namespace dynslam;
using test::McapLayout, test::McapWriter, test::shell, test::TemporaryFolder;
namespace bag = runtime::bag;
namespace fs = std::filesystem;

/// Whether the packages are there; they are fetched once for a build.
bool has_mcap_oracle() {
  static const bool there = [] {
    const std::string command = fmt::format(
        "command -v node && command -v npm && mkdir -p '{0}' && cd '{0}' && cp '{1}'/* . && (cmp -s "
        "package-lock.json "
        "installed || (timeout 120 npm ci --ignore-scripts --no-audit --no-fund && cp package-lock.json "
        "installed))",
        DYNSLAM_MCAP_ORACLE_WORK, DYNSLAM_MCAP_ORACLE);
    const bool done = shell(command + " 2>&1").code == 0;
    if (!done) MESSAGE("skipped: no node, no npm, or npm could not fetch @mcap/core");
    return done;
  }();
  return there;
}

std::string mcap_oracle(const std::string& arguments) {
  const test::ProgramResult result =
      shell(fmt::format("cd '{}' && node oracle.mjs {} 2>&1", DYNSLAM_MCAP_ORACLE_WORK, arguments));
  CAPTURE(result.out);
  REQUIRE(result.code == 0);
  return result.out;
}

/// As the oracle lists messages.
std::string list_of(const bag::Recording& file) {
  std::string list;
  file.scan([&](const bag::Connection& connection, const bag::Place& place) {
    const auto bytes = file.read(place);
    std::uint32_t sum = 0;
    for (const std::uint8_t byte : bytes) sum = 31 * sum + byte;
    const auto slash = connection.type.find('/');
    list += fmt::format("{} {}/msg{} {} {}\n", connection.topic, connection.type.substr(0, slash),
                        connection.type.substr(slash), bytes.size(), sum);
  });
  return list;
}

bag::McapFile mcap_at(const fs::path& path) {
  return bag::McapFile(std::make_unique<bag::FileBytes>(path));
}

/// The compressions of which the oracle, this build and the tests know.
std::vector<std::string> oracle_compressions() {
  std::vector<std::string> all{"none"};
  for (const char* name : {"lz4", "zstd"}) {
    if (bag::can_decompress(name) && shell(fmt::format("command -v {}", name)).code == 0)
      all.emplace_back(name);
  }
  return all;
}

}  // namespace

TEST_CASE("@mcap/core finds the messages that the tests wrote") {
  if (!has_mcap_oracle()) return;
  const TemporaryFolder folder;
  const fs::path file = folder.path / "own.mcap";
  const auto known = oracle_compressions();
  for (std::string compression : test::mcap_compressions()) {
    if (!compression.empty() && std::find(known.begin(), known.end(), compression) == known.end()) continue;
    for (const std::size_t per_chunk : {0U, 3U}) {
      test::write_file(
          file, test::small_recording<McapWriter>().bytes({per_chunk, compression, false, true, "cdr"}));
      const std::string expected = mcap_oracle("list " + file.string());
      CHECK(std::count(expected.begin(), expected.end(), '\n') == 5 * test::kSmallFrames);
      CHECK(list_of(mcap_at(file)) == expected);
    }
  }
}

TEST_CASE("files by @mcap/core are read: every message, decoded, in every way of compressing them") {
  if (!has_mcap_oracle()) return;
  const TemporaryFolder folder;
  const fs::path path = folder.path / "theirs.mcap";
  for (const std::string& compression : oracle_compressions()) {
    for (const char* chunk : {"0", "1000", "1000000"}) {
      CAPTURE(compression);
      CAPTURE(chunk);
      mcap_oracle(fmt::format("write {} {} {}", path.string(), compression, chunk));
      const bag::McapFile file = mcap_at(path);
      CHECK(list_of(file) == mcap_oracle("list " + path.string()));
      const bag::BagSurvey found = bag::survey(file);
      CHECK(found.missing.empty());
      REQUIRE(found.images.size() == 3);
      const bag::ImageTopic &depth = found.images[0], &colour = found.images[1], &jpeg = found.images[2];
      REQUIRE(depth.shots.size() == 5);
      for (std::size_t k = 0; k < 5; ++k) {
        CHECK(colour.shots[k].stamp == 100250000000U + k * 1000000000U);
        const auto c = file.read(colour.shots[k].place), d = file.read(depth.shots[k].place);
        const cv::Mat bgr = bag::decode_colour(bag::parse_image(c, "c", colour.serialisation), false, "c");
        const cv::Mat z = bag::decode_depth(bag::parse_image(d, "d", depth.serialisation), false, "d");
        const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(7 * i + k); };
        CHECK(bgr.at<cv::Vec3b>(5, 7) == cv::Vec3b(byte(143), byte(142), byte(141)));
        CHECK(z.at<std::uint16_t>(5, 7) == 1047 + k);
        const auto packed = file.read(jpeg.shots[k].place);
        CHECK(bag::parse_compressed_image(packed, "j", jpeg.serialisation).data.size() == 7);
      }
      const bag::CameraInfoMessage& info = found.infos.at("/camera_info").info;
      CHECK(info.width == 8);
      CHECK(info.d == std::vector<double>{0.1, -0.2, 0.001, -0.002, 0.05});
      CHECK(info.k == std::array<double, 9>{9, 0, 4, 0, 10, 3, 0, 0, 1});
      CHECK(info.p[6] == 3);
      REQUIRE(found.tracks.size() == 3);  // tf, odometry, pose
      for (const bag::PoseTrack& track : found.tracks) {
        CAPTURE(track.topic);
        REQUIRE(track.poses.size() == 5);
        CHECK((track.poses[3].second.translation() - Eigen::Vector3d(0.3, 0.2, 0.3)).norm() < 1e-12);
        CHECK(track.poses[3].second.so3().quaternion().z() == doctest::Approx(0.6));
      }
      CHECK(bag::truth_of(found, "cam").source == "/tf (world -> cam)");
    }
  }
}
