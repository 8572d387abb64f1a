// SPDX-License-Identifier: BSD-3-Clause
// `dynslam masks` as a user, and a program in another language, calls it.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/synth/synth.hpp"
#include "error_text.hpp"
#include "program.hpp"
#include "small_sequence.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using test::call, test::check_one_line_error, test::mentions, test::shell, test::ProgramResult;

namespace {

/// 12 frames in which a person walks, and the masks of `dynslam run`.
struct Walking : test::TemporaryFolder {
  std::filesystem::path sequence = path / "sequence", run = path / "run";
  std::vector<std::filesystem::path> masks;  // in order of time
  Walking() {
    runtime::SynthOptions options;
    options.frames = 12;
    options.width = 320;
    options.height = 240;
    runtime::synthesize(options, sequence);
    REQUIRE(call("run " + sequence.string() + " --no-map --save-masks --out " + run.string()).code == 0);
    for (const auto& entry : std::filesystem::directory_iterator(run / "masks"))
      masks.push_back(entry.path());
    std::sort(masks.begin(), masks.end());
    REQUIRE(masks.size() == 12);
  }
};

std::string content(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The first block of Python on a page.
std::string python_of(const std::filesystem::path& page) {
  const std::string text = content(page);
  const std::size_t begin = text.find("```python\n") + 10, end = text.find("```", begin);
  REQUIRE(end != std::string::npos);
  return text.substr(begin, end - begin);
}

}  // namespace

TEST_CASE("masks of a sequence are those of run, and nothing else is made") {
  const Walking walking;
  const std::filesystem::path out = walking.path / "masks";
  const ProgramResult r = call("masks " + walking.sequence.string() + " --out " + out.string());
  CAPTURE(r.out);
  CHECK(r.code == 0);
  CHECK(r.out.find("12 masks in " + out.string()) == 0);
  CHECK(std::distance(std::filesystem::directory_iterator(out), {}) == 12);
  bool any = false;
  for (const auto& mask : walking.masks) {
    CHECK(content(out / mask.filename()) == content(mask));
    any = any || cv::countNonZero(cv::imread(mask.string(), cv::IMREAD_UNCHANGED)) > 0;
  }
  CHECK(any);
  check_one_line_error("masks " + walking.sequence.string(), 2, "need --out");
  check_one_line_error("masks " + walking.path.string() + "/absent --out " + out.string(), 1, "absent");
}

TEST_CASE(
    "of a sequence that is mostly broken no masks are a success, and masks of an earlier one are said") {
  const test::TemporaryFolder folder;
  test::copy_sequence(folder.path / "seq");
  const std::string at = folder.path.string(), command = "masks " + at + "/seq --out " + at + "/m";
  const auto damage = [&](std::ptrdiff_t images) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path / "seq" / "rgb"))
      files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    for (auto file = files.begin(); file != files.begin() + images; ++file) test::write_text(*file, "x");
  };
  damage(3);
  std::filesystem::create_directories(folder.path / "m");
  test::write_text(folder.path / "m" / "1.png", "earlier");
  const ProgramResult some = call(command);
  CAPTURE(some.out);
  CHECK(some.code == 0);
  CHECK(std::count(some.out.begin(), some.out.end(), '\n') >= 5);  // broken, left over, and what was made
  CHECK(mentions(some.out, "m still holds 1 masks of an earlier run"));
  CHECK(mentions(some.out, "5 masks in "));
  damage(5);
  check_one_line_error(command, 1, "seq: 5 of 8 frames cannot be read; the first one: ");
}

TEST_CASE("faulty masks say how many they are, what they mark and what they replace") {
  const test::TumFixture tum(2);
  const std::string path = tum.path.string(), command = "mask-faults " + path + " " + path + "/f --fault ";
  const ProgramResult made = call(command + "empty");
  CHECK(made.code == 0);
  CHECK(made.out == "2 masks in " + path + "/f\nnone of the masks marks anything\n");
  const ProgramResult again = call(command + "object-always");
  CHECK(again.code == 0);
  CHECK(mentions(again.out, "warning: 2 masks that " + path + "/f held before are replaced\n"));
  CHECK(mentions(again.out, "2 masks in " + path + "/f; the sequence has no true masks (dynamic_mask/)\n"));
}

TEST_CASE("the client on the page of the stream gets run's masks") {
  if (shell("python3 -c pass 2>/dev/null").code != 0) {
    MESSAGE("SKIPPED: no python3");
    return;
  }
  const Walking walking;
  std::ofstream(walking.path / "client.py") << python_of(DYNSLAM_DOCS "/mask-stream.md") << R"(
import os, sys
program, root, out = sys.argv[1:]
lines = lambda name: [l.split() for l in open(os.path.join(root, name)) if l[0] != "#"]
read = lambda name: open(os.path.join(root, name), "rb").read()
def frames():
    for (stamp, colour), (_, depth) in zip(lines("rgb.txt"), lines("depth.txt")):
        seconds, fraction = stamp.split(".")
        yield int(seconds + fraction.ljust(9, "0")), read(colour), read(depth)
camera = " ".join(l.split("#")[0].strip() for l in open(os.path.join(root, "camera.txt")))
for i, (ns, tracked, mask) in enumerate(masks(frames(), camera, program)):
    assert tracked == 1 and ns == [f[0] for f in frames()][i]
    open(os.path.join(out, "%02d.raw" % i), "wb").write(mask)
)";
  const ProgramResult r = shell("python3 " + (walking.path / "client.py").string() + " " DYNSLAM_PROGRAM " " +
                                walking.sequence.string() + " " + walking.path.string() + " 2>&1");
  CAPTURE(r.out);
  REQUIRE(r.code == 0);
  CHECK(r.out.find("12 masks, 12 of frames with a pose") == 0);
  for (std::size_t i = 0; i < walking.masks.size(); ++i) {
    CAPTURE(i);
    const cv::Mat mask = cv::imread(walking.masks[i].string(), cv::IMREAD_UNCHANGED);
    const std::string raw =
        content(walking.path / (std::string(i < 10 ? "0" : "") + std::to_string(i) + ".raw"));
    REQUIRE(raw.size() == mask.total());
    CHECK(std::equal(raw.begin(), raw.end(), mask.ptr<char>()));
  }
}

TEST_CASE("a damaged stream is one line with the frame and the reason") {
  const test::TemporaryFolder folder;
  const std::string file = (folder.path / "stream").string();
  const auto error_of = [&](const std::string& stream) {
    test::write_file(file, stream);
    const ProgramResult r = shell(DYNSLAM_PROGRAM " masks - 2>&1 >/dev/null < " + file);
    CHECK(r.code == 1);
    CHECK(std::count(r.out.begin(), r.out.end(), '\n') == 1);
    CHECK(r.out.starts_with("dynslam: error: standard input: "));
    return r.out;
  };
  const std::string head = "dynslam-frames 1\nfr3\n";
  CHECK(error_of("").find("does not begin with the line") != std::string::npos);
  CHECK(error_of(head).find("has no frame that can be read") != std::string::npos);
  CHECK(error_of(head + "FRME").find("frame 1: ends within the frame's head, after 4 of 24 bytes") !=
        std::string::npos);
  check_one_line_error("masks - --camera fr3 < /dev/null", 2, "second line");
}
