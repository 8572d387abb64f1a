// SPDX-License-Identifier: BSD-3-Clause
// Texts as people have them: lists, ground truths, configurations. Nothing comes of nothing without a line.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "user_input.hpp"

namespace fs = std::filesystem;
using namespace dynslam::test;

namespace {

constexpr std::string_view kMark = "\xEF\xBB\xBF";

void mark(const fs::path& file) {
  write_text(file, std::string(kMark) + text_of(file));
}

/// As Windows writes "Unicode": two bytes a letter. @param marked  with a byte order mark before it
void widen(const fs::path& file, bool marked) {
  std::string wide = marked ? "\xFF\xFE" : "";
  for (const char c : text_of(file)) (wide += c) += '\0';
  write_text(file, wide);
}

}  // namespace

TEST_CASE("a byte order mark is no part of a text, and UTF-16 is named") {
  const auto marked = [](const std::vector<const char*>& files) {
    return [=](const fs::path& root) {
      for (const char* file : files) mark(root / file);
    };
  };
  const auto without_pairs = [](const fs::path& root) {
    fs::remove(root / "associations.txt");
    for (const char* file : {"rgb.txt", "depth.txt", "groundtruth.txt", "camera.txt"}) mark(root / file);
  };
  check_all({
      {"associations, truth, camera", marked({"associations.txt", "groundtruth.txt", "camera.txt"}), kRun, 0,
       kTracked},
      {"lists", without_pairs, kRun, 0, kTracked},
      {"trajectories",
       marked({"groundtruth.txt"}),
       "eval SEQ/groundtruth.txt SEQ/groundtruth.txt",
       0,
       {"ATE [m]", "no RPE: fewer than 2 intervals of 1 s"}},
      {"camera in YAML",
       [](const fs::path& root) {
         write_text(root / "own.yaml",
                    "image_width: 320\nimage_height: 240\nK: [267.7, 0, 159.8, 0, 269.6, "
                    "123.55, 0, 0, 1]\ndepth_units_per_metre: 5000\n");
         mark(root / "own.yaml");
       },
       "run SEQ --camera SEQ/own.yaml --dynamics none --no-map --out OUT", 0, kTracked},
      {"configuration",
       [](const fs::path& root) {
         write_text(root / "c.toml", "seed = 3\n");
         mark(root / "c.toml");
       },
       "run SEQ --config SEQ/c.toml --dynamics none --no-map --out OUT", 0, kTracked},
      {"sweep",
       [](const fs::path& root) {
         write_text(root / "s.toml", "sequences = [\".\"]\nmodes = [\"none\"]\n");
         mark(root / "s.toml");
       },
       "sweep SEQ/s.toml --out OUT --gather",
       1,
       {"1 of 1 jobs are not done"}},
      {"UTF-16",
       [](const fs::path& root) { widen(root / "associations.txt", true); },
       kRun,
       1,
       {"associations.txt: is text in UTF-16: save it as UTF-8"}},
      {"UTF-16 without a mark",
       [](const fs::path& root) { widen(root / "camera.txt", false); },
       kRun,
       1,
       {"camera.txt: is text in UTF-16"}},
      {"configuration in UTF-16",
       [](const fs::path& root) {
         write_text(root / "c.toml", "seed = 3\n");
         widen(root / "c.toml", true);
       },
       "run SEQ --config SEQ/c.toml --out OUT",
       1,
       {"c.toml: is text in UTF-16"}},
  });
}

TEST_CASE("stamps that are no seconds, and a ground truth of other times, are named with what would fit") {
  const auto stamped = [](const std::function<std::string(std::size_t, double)>& stamp) {
    return [=](const fs::path& root) { change_stamps(root, stamp); };
  };
  const auto truth = [](double factor, double offset) {
    return [=](const fs::path& root) {
      change_lines(root / "groundtruth.txt", [&](std::size_t, const std::string& line) {
        return fmt::format("{:.6f}", factor * std::stod(line) + offset) + line.substr(line.find(' '));
      });
    };
  };
  const auto milliseconds = stamped([](std::size_t, double t) { return fmt::format("{:.0f}", 1e3 * t); });
  check_all({
      {"milliseconds",
       milliseconds,
       kInfo,
       0,
       {"by their stamps, which are seconds, not milliseconds: times 0.001 they would be 30",
        "the images' stamps times 0.001 would fit it"},
       {"warnings  none"}},
      {"milliseconds are not waited for",
       milliseconds,
       "run SEQ --live --dynamics none --no-map --out OUT",
       0,
       {"7 gaps between frames are longer than live_gap = 10 s", "not milliseconds"}},
      {"microseconds",
       stamped([](std::size_t, double t) { return fmt::format("{:.0f}", 1e6 * t); }),
       kInfo,
       0,
       {"not microseconds", "the images' stamps times 1e-06 would fit it"}},
      {"numbers",
       stamped([](std::size_t i, double) { return std::to_string(i); }),
       kInfo,
       0,
       {"numbers of frames? Stamps are seconds", "the images' stamps times 0.0333333 and "},
       {"warnings  none"}},
      {"kiloseconds",
       stamped([](std::size_t, double t) { return fmt::format("{:.9f}", 1e-3 * t); }),
       kInfo,
       0,
       {"times 1000 they would be 30"}},
      {"another clock",
       truth(1, 1e6),
       kInfo,
       0,
       {"the ground truth has a pose for 0 % of the pairs; it is from ",
        "another clock? The images' stamps and 1000000.000 s more would begin with it"}},
      {"truth in milliseconds", truth(1e3, 0), kInfo, 0, {"its stamps times 0.001 would fit the images"}},
      {"sparse truth",
       [](const fs::path& root) {
         const std::string text = text_of(root / "groundtruth.txt");
         std::string kept;
         std::size_t number = 0;
         std::istringstream in(text);
         for (std::string line; std::getline(in, line);)
           if (line.starts_with('#') || number++ % 7 == 0) kept += line + "\n";
         write_text(root / "groundtruth.txt", kept);
       },
       kInfo,
       0,
       {"its poses are 0.233 s apart"}},
      {"sound", {}, kInfo, 0, {}, {"the ground truth has a pose for", "Hz) by their stamps"}},
  });
}

TEST_CASE("a ground truth that is damaged stops nothing: what is no pose is left out, counted and said") {
  const auto row = [](std::size_t number, const std::string& becomes) {
    return [=](const fs::path& root) {
      change_lines(root / "groundtruth.txt", [&](std::size_t i, const std::string& line) {
        return i == number ? line.substr(0, line.find(' ')) + becomes : line;
      });
    };
  };
  const auto columns = [](const std::string& more) {
    return [=](const fs::path& root) {
      change_lines(root / "groundtruth.txt",
                   [&](std::size_t, const std::string& line) { return line + more; });
    };
  };
  const std::string left_out = "1 of 8 poses are left out; the first: ";
  struct Fault {
    std::string name;
    std::function<void(const fs::path&)> change;
    std::string says;
    bool none;
  };
  const std::vector<Fault> faults{
      {"NaN", row(2, " nan nan nan 0 0 0 1"), left_out, false},
      {"zero quaternion", row(0, " 0 0 0 0 0 0 0"), left_out, false},
      {"cut line", row(7, " 0 0 0"), left_out, false},
      {"header",
       [](const fs::path& root) {
         write_text(root / "groundtruth.txt",
                    "time tx ty tz qx qy qz qw\n" + text_of(root / "groundtruth.txt"));
       },
       "1 of 9 poses are left out", false},
      {"9 columns", columns(" 7"), "expected 8 columns (timestamp tx ty tz qx qy qz qw), found 9", true},
      {"12 columns", columns(" 7 7 7 7"), "found 12", true},
      {"empty", [](const fs::path& root) { write_text(root / "groundtruth.txt", ""); },
       "groundtruth.txt: holds no poses", true},
      {"comments alone", [](const fs::path& root) { write_text(root / "groundtruth.txt", "# none\r\n\r\n"); },
       "groundtruth.txt: holds no poses", true},
      {"binary", [](const fs::path& root) { write_text(root / "groundtruth.txt", "\x89PNG\r\n\x1a\n"); },
       "groundtruth.txt:", true}};
  for (const Fault& fault : faults) {
    check_input({fault.name + ", run",
                 fault.change,
                 kRun,
                 0,
                 {"8 of 8 frames tracked", fault.says,
                  fault.none ? "no ATE and RPE, for want of a ground truth: " : "ATE [m]"}});
    check_input({fault.name + ", info", fault.change, kInfo, 0, {fault.says}, {"warnings  none"}});
    check_input({fault.name + ", convert", fault.change, "convert SEQ OUT", 0, {"8 frames in ", fault.says}});
  }
  const auto separated = [](const std::string& by, const std::string& end) {
    return [=](const fs::path& root) {
      for (const char* file : {"groundtruth.txt", "associations.txt"})
        change_lines(root / file,
                     [&](std::size_t, const std::string& line) { return filled(line, " ", by) + end; });
    };
  };
  check_all({{"tabs and CRLF", separated("\t", "\r"), kRun, 0, kTracked},
             {"commas and trailing blanks", separated(", ", "  "), kRun, 0, kTracked},
             {"estimate with a lost marker",
              row(3, " nan nan nan nan nan nan nan"),
              "eval SEQ/groundtruth.txt SEQ",
              0,
              {left_out, "ATE [m]"}}});
}

TEST_CASE("lists with times that come twice or in no order are read, and that is said") {
  const auto lines = [](const std::function<std::string(std::string)>& change) {
    return [=](const fs::path& root) {
      fs::remove(root / "associations.txt");
      write_text(root / "rgb.txt", change(text_of(root / "rgb.txt")));
    };
  };
  check_all({
      {"twice",
       lines([](std::string text) { return text + text; }),
       kRun,
       0,
       {"8 of 8 frames tracked", "rgb.txt: the lines are not sorted by time",
        "rgb.txt: 8 of 16 lines have the time"}},
      {"backwards",
       lines([](const std::string& text) {
         std::istringstream in(text);
         std::string all;
         for (std::string line; std::getline(in, line);) all = line + "\n" + all;
         return all;
       }),
       kRun,
       0,
       {"8 of 8 frames tracked", "rgb.txt: the lines are not sorted by time"}},
      {"sorted", {}, kRun, 0, kTracked, {"not sorted", "left out"}},
  });
}
