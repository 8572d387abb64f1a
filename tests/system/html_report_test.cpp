// SPDX-License-Identifier: BSD-3-Clause
// What is in a report; tests/report/ looks at it in a browser.
#include "dynslam/runtime/report/html_report.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <span>

#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "error_text.hpp"
#include "io/base64.hpp"
#include "io/run_lengths.hpp"
#include "program.hpp"
#include "report/evidence.hpp"
#include "run/evidence_log.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;
using test::bytes;

namespace {

const std::string kBefore = "<html><script type=\"application/json\">", kAfter = "</script></html>";

/// Two runs with a report and one without, of a sequence whose name would end a script.
struct ReportedRuns {
  test::TemporaryFolder folder;
  fs::path sequence = folder.path / "a<!--<b>&'\"", page = folder.path / "page.html";
  ReportedRuns() {
    SynthOptions synth;
    synth.frames = 40;
    synth.path = "xyz";
    synth.seed = 2;
    synthesize(synth, sequence);
    test::write_file(page, kBefore + "@DYNSLAM_REPORT@" + kAfter);
    run("both", DynamicsMode::both, true);
    run("none", DynamicsMode::none, true);
    run("plain", DynamicsMode::both, false);
  }
  void run(const char* name, DynamicsMode mode, bool report) const {
    RunOptions o = test::options_for(sequence, folder.path / name, mode);
    o.report = report;
    (void)run_sequence(o, test::kNeverStop);
  }
  [[nodiscard]] ReportOptions options(const std::vector<std::string>& runs) const {
    ReportOptions o;
    for (const std::string& name : runs) o.runs.push_back(folder.path / name);
    o.page = page;
    o.out = folder.path / "report.html";
    return o;
  }
  /// A copy of a run, to be damaged.
  [[nodiscard]] fs::path copy(const char* name) const {
    const fs::path place = folder.path / "copy";
    fs::remove_all(place);
    fs::copy(folder.path / name, place, fs::copy_options::recursive);
    return place;
  }
};

const ReportedRuns& reported() {
  static const ReportedRuns made;
  return made;
}

/// What the page holds.
nlohmann::json payload_of(const fs::path& report) {
  const std::string text = bytes(report);
  REQUIRE(text.starts_with(kBefore));
  REQUIRE(text.ends_with(kAfter));
  return nlohmann::json::parse(text.substr(kBefore.size(), text.size() - kBefore.size() - kAfter.size()));
}

cv::Mat mask_of(const nlohmann::json& runs, const nlohmann::json& size) {
  const auto packed = from_base64(runs.get<std::string>());
  REQUIRE(packed);
  const auto values = decode_runs(*packed, {size[0].get<int>(), size[1].get<int>()});
  REQUIRE(values);
  return *values;
}

std::string failure(const ReportOptions& options) {
  return test::error_of([&] { (void)write_report(options); });
}

void replace_in(const fs::path& file, const std::string& what, const std::string& by) {
  std::string text = bytes(file);
  REQUIRE(text.find(what) != std::string::npos);
  test::write_file(file, text.replace(text.find(what), what.size(), by));
}

}  // namespace

TEST_CASE("a report has the errors, frames, masks, keypoints, graph and map of its runs") {
  const ReportedRuns& r = reported();
  const ReportResult result = write_report(r.options({"none", "both"}));
  CHECK(result.missing.empty());
  CHECK(result.bytes == fs::file_size(result.file));
  const nlohmann::json j = payload_of(result.file);
  REQUIRE(j["runs"].size() == 2);
  CHECK(j["sequence"]["name"] == r.sequence.filename().string());
  CHECK(j["runs"][0]["mode"] == "none");
  const nlohmann::json& both = j["runs"][1];
  CHECK(both["table"] == to_json(evaluate_trajectory(r.folder.path / "both", r.sequence, {})));
  CHECK(both["trajectory"]["t"].size() == 40);
  CHECK(both["trajectory"]["p"].size() == 120);
  CHECK(both["error"]["e"].size() == both["table"]["pairs"].get<std::size_t>());
  CHECK(both["times"]["cells"][0].size() == 40);
  CHECK(both["times"]["stages"]["tracking"][0].get<double>() > 0);
  CHECK(both["config"] == bytes(r.folder.path / "both" / "config.toml"));
  CHECK(both["graph"]["nodes"].size() >= 2);
  CHECK(both["graph"]["edges"].size() >= 1);
  CHECK(both["map"]["count"].get<std::size_t>() > 1000);
  CHECK(from_base64(both["map"]["voxels"].get<std::string>())->size() ==
        11 * both["map"]["count"].get<std::size_t>());
  CHECK(both["map"]["classes"].size() >= 2);

  const nlohmann::json& frames = j["frames"];
  REQUIRE(frames["stamp"].size() == 40);
  const std::size_t k = 25;
  const auto stamp = frames["stamp"][k].get<std::string>();
  const auto jpeg = from_base64(frames["colour"][k].get<std::string>());
  CHECK(cv::imdecode(*jpeg, cv::IMREAD_COLOR).cols == frames["size"][0].get<int>());
  // The fused mask is the one that was saved, the semantic one that of the labels.
  const cv::Mat masks = mask_of(both["shown"]["masks"][k], frames["mask_size"]);
  const auto expected = [&](const fs::path& file, int value) {
    cv::Mat small;
    const cv::Mat image = read_image(file, cv::IMREAD_GRAYSCALE);
    cv::resize(value < 0 ? image != 0 : image == value, small, masks.size(), 0, 0, cv::INTER_NEAREST);
    return small;
  };
  const auto equal = [](const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b) == 0; };
  CHECK(equal(pixels_with(masks, kFusedBit),
              expected(r.folder.path / "both" / "masks" / (stamp + ".png"), -1)));
  CHECK(equal(pixels_with(masks, kSemanticBit), expected(r.sequence / "label" / (stamp + ".png"), 1)));
  CHECK(cv::countNonZero(pixels_with(masks, kGeometricBit)) > 0);
  CHECK(equal(mask_of(frames["truth"][k], frames["mask_size"]) != 0,
              expected(r.sequence / "dynamic_mask" / (stamp + ".png"), -1)));
  CHECK(from_base64(both["shown"]["keypoints"][k].get<std::string>())->size() > 4 * 100);
  CHECK(both["shown"]["state"][k] == "tracked");
  CHECK(j["runs"][0]["shown"]["keypoints"][k].is_null());  // nobody asked the geometry

  const MaskReport report = evaluate_masks(r.folder.path / "both" / "masks", r.sequence / "dynamic_mask");
  CHECK(both["mask_figures"]["iou"].get<double>() == doctest::Approx(report.iou).epsilon(1e-3));
}

TEST_CASE("whatever a sequence is called, nothing of it is taken for HTML") {
  const ReportedRuns& r = reported();
  const ReportResult result = write_report(r.options({"both"}));
  const std::string text = bytes(result.file);
  const std::string inside = text.substr(kBefore.size(), text.size() - kBefore.size() - kAfter.size());
  CHECK(inside.find_first_of("<>&") == std::string::npos);
}

TEST_CASE("a run without --report writes the same, and its report shows what there is") {
  const ReportedRuns& r = reported();
  for (const char* file :
       {"trajectory.txt", "keyframes.txt", "map.sot", "map_color.ot", "masks/1000000.500000.png"}) {
    CAPTURE(file);
    CHECK(bytes(r.folder.path / "plain" / file) == bytes(r.folder.path / "both" / file));
  }
  CHECK_FALSE(fs::exists(r.folder.path / "plain" / "report.jsonl"));
  const ReportResult written = write_report(r.options({"plain"}));
  REQUIRE(written.missing.size() == 1);
  CHECK(written.missing[0] == (r.folder.path / "plain").string() +
                                  " was run without --report, the page lacks the edges of its graph and the "
                                  "keypoints of its frames: run it again with --report");
  const nlohmann::json j = payload_of(written.file);
  CHECK(j["runs"][0]["shown"]["from"] == "masks");
  CHECK_FALSE(j["runs"][0]["shown"]["masks"][25].is_null());
  CHECK(j["runs"][0]["graph"]["complete"] == false);
  // What an earlier run recorded is not taken for this one's.
  const fs::path copy = r.copy("both");
  RunOptions again = test::options_for(r.sequence, copy, DynamicsMode::none);
  again.max_frames = 5;
  (void)run_sequence(again, test::kNeverStop);
  CHECK_FALSE(fs::exists(copy / "report.jsonl"));
}

TEST_CASE("a report keeps its size by leaving out frames, and says so") {
  const ReportedRuns& r = reported();
  ReportOptions o = r.options({"both"});
  const std::size_t full = write_report(o).bytes;
  const std::size_t pictures = [&] {
    std::size_t sum = 0;
    const nlohmann::json j = payload_of(o.out);
    for (const char* kind : {"colour", "depth", "truth"}) sum += j["frames"][kind].dump().size();
    for (const char* kind : {"masks", "keypoints"}) sum += j["runs"][0]["shown"][kind].dump().size();
    return sum;
  }();
  o.max_bytes = full - pictures / 8 * 7;
  const ReportResult small = write_report(o);
  CHECK(small.bytes <= o.max_bytes);
  const nlohmann::json j = payload_of(o.out);
  CHECK(j["frames"]["stride"].get<int>() > 1);
  CHECK(j["frames"]["stamp"].size() < 40);
  CHECK(j["thinned"] == nlohmann::json(small.thinned));
  CHECK(j["thinned"].dump().find("one of " + std::to_string(j["frames"]["stride"].get<int>()) +
                                 " frames, of 40") != std::string::npos);
  o.max_bytes = 1000;
  CHECK(test::mentions(failure(o), "1000 are allowed"));
}

TEST_CASE("folders that hold no finished run, and damaged ones, are named with the reason") {
  const ReportedRuns& r = reported();
  ReportOptions o = r.options({"absent"});
  CHECK(test::mentions(failure(o), "absent: is no folder of a run"));
  o = r.options({"copy"});
  const auto damaged = [&](const char* file, const std::string& what, const std::string& by) {
    const fs::path copy = r.copy("both");
    replace_in(copy / file, what, by);
    return failure(o);
  };
  for (const char* file : {"summary.json", "config.toml", "trajectory.txt", "keyframes.txt", "timings.csv"}) {
    CAPTURE(file);
    fs::remove(r.copy("both") / file);
    CHECK(test::mentions(failure(o), std::string(file) + ": is missing: the folder holds no finished run"));
  }
  CHECK(test::mentions(damaged("summary.json", "{", "["), "summary.json: is damaged"));
  CHECK(
      test::mentions(damaged("summary.json", "\"fps\"", "\"spf\""), "summary.json: is no summary of a run"));
  CHECK(test::mentions(damaged("timings.csv", "1000000.000000,", "1000000.000000,x"), "timings.csv:2: 'x"));
  CHECK(test::mentions(damaged("timings.csv", "1000000.000000,", "7,"), "has a frame 7 that is not in"));
  CHECK(test::mentions(damaged("config.toml", "map_memory = ", "map_memory = x"), "config.toml:"));
  CHECK(test::mentions(damaged("report.jsonl", "\"masks\":\"", "\"masks\":\"AAAA"),
                       "report.jsonl:2: is damaged: masks"));
  CHECK(test::mentions(damaged("report.jsonl", "\"report\"", "\"retort\""), "report.jsonl:1: is damaged"));
  CHECK(test::mentions(damaged("map.sot", "# Octomap", "# Optomap"), "map.sot: is corrupt: its check sum differs"));
  const fs::path copy = r.copy("both");
  fs::resize_file(copy / "report.jsonl", fs::file_size(copy / "report.jsonl") / 2);
  CHECK(test::mentions(failure(o), "report.jsonl"));
  test::write_file(r.folder.path / "no.html", "<html></html>");
  o = r.options({"both"});
  o.page = r.folder.path / "no.html";
  CHECK(test::mentions(failure(o), "is no page of reports"));
}

TEST_CASE(
    "a sequence that has moved is found where --sequence says; two sequences do not go into one report") {
  const ReportedRuns& r = reported();
  const fs::path copy = r.copy("both");
  replace_in(copy / "report.jsonl", r.sequence.filename().string().substr(0, 1) + "<!--", "gone<!--");
  ReportOptions o = r.options({"copy"});
  CHECK(test::mentions(failure(o), "is missing: say where the sequence of the run lies now (--sequence)"));
  o.sequence = r.sequence;
  CHECK(write_report(o).bytes > 0);
  CHECK(test::mentions(failure(r.options({"both", "copy"})), "a report is about one sequence"));
}

TEST_CASE("bytes and images come back from their texts, and nothing else does") {
  for (const std::string text : {"", "f", "fo", "foo", "foob", "\xFF\x01"}) {
    const std::vector<std::uint8_t> in(text.begin(), text.end());
    CHECK(from_base64(to_base64(in)) == in);
  }
  CHECK(to_base64(std::vector<std::uint8_t>{'f', 'o', 'o', 'b'}) == "Zm9vYg==");
  for (const char* text : {"Zg=", "Z===", "Zm9v Zg=", "Zm=v"}) CHECK_FALSE(from_base64(text));
  cv::Mat image = cv::Mat::zeros(48, 64, CV_8UC1);
  image(cv::Rect(10, 5, 20, 30)) = 5;
  image(cv::Rect(63, 47, 1, 1)) = 7;
  auto runs = encode_runs(image);
  const auto back = decode_runs(runs, image.size());
  REQUIRE(back);
  CHECK(cv::countNonZero(*back != image) == 0);
  CHECK_FALSE(decode_runs(runs, {64, 47}));
  CHECK_FALSE(decode_runs(runs, {64, 49}));
  runs.back() |= 128;  // goes on behind the end
  CHECK_FALSE(decode_runs(runs, image.size()));
}

TEST_CASE("dynslam report says in one line what is wrong") {
  const auto result = test::call("report /nowhere/at/all");
  CHECK(result.code != 0);
  CHECK(result.out.starts_with("dynslam: error: "));
  CHECK(std::count(result.out.begin(), result.out.end(), '\n') == 1);
  CHECK(test::call("report").code == 2);
  CHECK(test::call("report x --max-mb 0").code == 2);
}
