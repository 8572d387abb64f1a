// SPDX-License-Identifier: BSD-3-Clause
// Against librosbag-storage: it reads the tests' bags, and dynslam reads the bags that it writes, in every
// way of compressing them.
#include <doctest/doctest.h>

#ifdef DYNSLAM_ROSBAG_ORACLE

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "bag_fixture.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/run/run_sequence.hpp"
#include "error_text.hpp"
#include "io/bag/bag_chunk.hpp"
#include "io/bag/bag_file.hpp"
#include "program.hpp"
#include "random.hpp"
#include "run_fixture.hpp"

namespace {

using namespace dynslam;
using namespace dynslam::test;
namespace bag = runtime::bag;

std::string oracle(const std::string& arguments) {
  const ProgramResult result = shell(std::string(DYNSLAM_ROSBAG_ORACLE) + " " + arguments + " 2>&1");
  CAPTURE(result.out);
  REQUIRE(result.code == 0);
  return result.out;
}

/// The oracle's list as this reader makes it: topic, type, size and check sum by the file's order.
std::string own_list(const std::filesystem::path& path) {
  const bag::BagFile file(std::make_unique<bag::FileBytes>(path));
  std::string list;
  file.scan([&](const bag::Connection& connection, const bag::Place& place) {
    const auto bytes = file.read(place);
    std::uint32_t sum = 0;
    for (const std::uint8_t byte : bytes) sum = 31 * sum + byte;
    list += fmt::format("{} {} {} {}\n", connection.topic, connection.type, bytes.size(), sum);
  });
  return list;
}

std::vector<std::string> sorted_lines(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  std::sort(lines.begin(), lines.end());
  return lines;
}

}  // namespace

TEST_CASE("librosbag and this reader find the same messages, in bags of both and of every compression") {
  const TemporaryFolder folder;
  const auto own = folder.path / "own.bag";
  write_file(own, bag_of_film({raw_colour(), metric_depth(), camera_info(), tf_truth()}).bytes());
  const auto expected = sorted_lines(oracle("list " + own.string()));
  CHECK(expected.size() == 4 * film().size());
  CHECK(sorted_lines(own_list(own)) == expected);
  for (const char* compression : {"none", "bz2", "lz4"}) {
    if (!bag::can_decompress(compression)) continue;
    for (const char* chunk : {"1000", "4000000"}) {
      CAPTURE(compression);
      const auto copy = folder.path / "copy.bag";
      oracle(fmt::format("copy {} {} {} {}", own.string(), copy.string(), compression, chunk));
      CHECK(sorted_lines(own_list(copy)) == expected);
      CHECK(runtime::load_sequence(copy).frames.size() == film().size());
    }
  }
}

TEST_CASE("a bag that librosbag wrote and compressed is run and evaluated") {
  for (const char* compression : {"bz2", "lz4"}) {
    if (!bag::can_decompress(compression)) continue;
    CAPTURE(compression);
    const TemporaryFolder folder;
    const auto own = folder.path / "own.bag", copy = folder.path / "copy.bag";
    write_file(own, bag_of_film({compressed_colour(), metric_depth(), camera_info(), tf_truth()}).bytes());
    oracle(fmt::format("copy {} {} {} 768000", own.string(), copy.string(), compression));
    runtime::RunOptions options;
    options.sequence = copy;
    options.out = folder.path / "out";
    options.dynamics = runtime::DynamicsMode::none;
    options.map = false;
    CHECK(run_sequence(options, kNeverStop).tracked == film().size());
    CHECK(runtime::evaluate_trajectory(folder.path / "out", copy, {}).ate.translation.rmse < 0.03);
    runtime::SequenceOptions reading;
    // A flipped byte in a compressed chunk is found by its check sum.
    std::string content = bytes(copy);
    content[content.size() / 2] = static_cast<char>(content[content.size() / 2] ^ 0x10);
    write_file(copy, content);
    CHECK(mentions(error_of([&] { (void)runtime::load_sequence(copy, reading); }), "copy.bag"));
  }
}

TEST_CASE("compressed bags with any bytes changed are read or refused") {
  const TemporaryFolder folder;
  const auto own = folder.path / "own.bag", copy = folder.path / "copy.bag";
  BagWriter writer;
  for (std::uint64_t k = 1; k < 30; ++k)
    writer.add("/pose", "geometry_msgs/PoseStamped", k, pose_message(k, "w", {}));
  write_file(own, writer.bytes());
  Rng rng("damaged compressed bags");
  for (const char* compression : {"bz2", "lz4"}) {
    if (!bag::can_decompress(compression)) continue;
    oracle(fmt::format("copy {} {} {} 500", own.string(), copy.string(), compression));
    const std::string whole = bytes(copy);
    std::size_t refused = 0;
    for (int k = 0; k < 300; ++k) {
      std::string damaged = whole;
      for (int n = rng.integer(1, 4); n > 0; --n)
        damaged[static_cast<std::size_t>(rng.integer(4096, static_cast<int>(whole.size()) - 1))] =
            static_cast<char>(rng.integer(0, 255));
      refused +=
          error_of([&] {
            const bag::BagFile file(std::make_unique<bag::MemoryBytes>(
                "x.bag", std::vector<std::uint8_t>(damaged.begin(), damaged.end())));
            file.scan([&](const bag::Connection&, const bag::Place& place) { (void)file.read(place); });
          }).empty()
              ? 0
              : 1;
    }
    CHECK(refused > 150);
  }
}

#else

TEST_CASE("librosbag and this reader find the same messages, in bags of both and of every compression") {
  MESSAGE("skipped: librosbag-storage-dev was not found when the tests were configured");
}

#endif
