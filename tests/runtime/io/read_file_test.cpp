// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/read_file.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>

#include <fstream>
#include <functional>
#include <istream>
#include <opencv2/imgcodecs.hpp>
#include <streambuf>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "error_text.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions;
namespace fs = std::filesystem;

namespace {

/// A disk that gives some text and then fails.
class FailingDisk : public std::streambuf {
 public:
  explicit FailingDisk(std::string text) : text_(std::move(text)) {
    setg(text_.data(), text_.data(), text_.data() + text_.size());
  }

 private:
  int_type underflow() override { throw std::ios_base::failure("EIO"); }
  std::string text_;
};

template <class Parse>
std::string failing(const std::string& text, Parse&& parse) {
  FailingDisk disk(text);
  std::istream in(&disk);
  return error_of([&] { (void)parse(in, std::string("x")); });
}

/// What opens a path.
struct Reader {
  std::string name;
  std::function<void(const fs::path&)> read;
};

std::vector<Reader> readers() {
  return {{"file", [](const fs::path& p) { (void)read_file(p); }},
          {"trajectory", [](const fs::path& p) { (void)read_trajectory(p); }},
          {"camera", [](const fs::path& p) { (void)load_camera(p.string()); }},
          {"image", [](const fs::path& p) { (void)read_image(p, cv::IMREAD_UNCHANGED); }},
          {"octree", [](const fs::path& p) { (void)load_map(p); }}};
}

}  // namespace

TEST_CASE("a whole file is read, also an empty one and one that does not tell its size") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path / "f";
  for (const std::size_t size : {std::size_t(0), std::size_t(1), std::size_t(100000)}) {
    std::string text(size, 'x');
    if (size > 10) text[7] = '\0';
    std::ofstream(path, std::ios::binary) << text;
    CHECK(read_file(path) == text);
  }
  CHECK(read_file("/proc/self/status").size() > 100);
  CHECK(mentions(error_of([&] { (void)read_file(path, 99999); }), "f: is longer than 99999 bytes"));
  CHECK(read_file(path, 100000).size() == 100000);
  CHECK(error_of([&] { (void)read_file(folder.path / "absent"); }) ==
        (folder.path / "absent").string() + ": cannot be opened");
  CHECK(mentions(error_of([&] { (void)read_file(folder.path); }), "it is a folder"));
}

TEST_CASE("an error of reading is told, not taken for the end of the file") {
  // Its first page belongs to nobody: reading it is EIO.
  CHECK(mentions(error_of([] { (void)read_file("/proc/self/mem"); }), "cannot be read: Input/output error"));
  for (const Reader& reader : readers()) {
    if (reader.name == "octree") continue;  // a stream, below
    CAPTURE(reader.name);
    CHECK(mentions(error_of([&] { reader.read("/proc/self/mem"); }), "cannot be read"));
  }
  const std::string half = "1.0 a.png\n2.0 b.png\n";
  CHECK(mentions(failing(half, parse_list), "x: cannot be read"));
  CHECK(mentions(failing("1 a 1 b\n", parse_associations), "x: cannot be read"));
  CHECK(mentions(failing("1 0 0 0 0 0 0 1\n", parse_trajectory), "x: cannot be read"));
  // The distortion would be missing.
  CHECK(mentions(failing("width = 640\nheight = 480\nfx = 500\nfy = 500\ncx = 320\ncy = 240\n", parse_camera),
                 "x: cannot be read"));
}

TEST_CASE("pipes and devices are refused at once, not waited for or read for ever") {
  const test::TemporaryFolder folder;
  const fs::path pipe = folder.path / "pipe";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  for (const Reader& reader : readers()) {
    for (const fs::path& path : {pipe, fs::path("/dev/zero")}) {
      CAPTURE(reader.name);
      CAPTURE(path.string());
      CHECK(mentions(error_of([&] { reader.read(path); }), "is not a regular file"));
    }
  }
  test::TumFixture tum(2);
  fs::remove(tum.path / "rgb.txt");
  fs::rename(pipe, tum.path / "rgb.txt");
  CHECK(mentions(error_of([&] { (void)load_sequence(tum.path); }), "rgb.txt: is not a regular file"));
  fs::rename(tum.path / "rgb.txt", folder.path / "keyframes.bin");
  CHECK(mentions(error_of([&] { (void)load_slam_map(folder.path, load_camera("fr1")); }),
                 "keyframes.bin: is not a regular file"));
}
