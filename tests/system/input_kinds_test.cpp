// SPDX-License-Identifier: BSD-3-Clause
// Each file format in each of the states that files are found in: a row each, with the command and what the
// program says. None is silent.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "constant_onnx.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "input_row.hpp"
#include "mask_files.hpp"

namespace fs = std::filesystem;
using namespace dynslam::test;
using dynslam::runtime::write_image;

namespace {

struct TextState {
  std::string_view name;
  std::function<std::string(const std::string&)> of;
};

/// Each line as `change` makes it; comments and empty ones stay.
std::string each_line(const std::string& text, const std::function<std::string(const std::string&)>& change) {
  std::istringstream in(text);
  std::string all;
  for (std::string line; std::getline(in, line);)
    all += (line.empty() || line[0] == '#' ? line : change(line)) + "\n";
  return all;
}

const std::vector<TextState>& text_states() {
  static const std::vector<TextState> all{
      {"CRLF", [](const auto& text) { return filled(text, "\n", "\r\n"); }},
      {"tabs",
       [](const auto& text) { return each_line(text, [](const auto& l) { return filled(l, " ", "\t"); }); }},
      {"commas",
       [](const auto& text) { return each_line(text, [](const auto& l) { return filled(l, " ", ","); }); }},
      {"trailing blanks",
       [](const auto& text) { return each_line(text, [](const auto& l) { return l + "  \t "; }); }},
      {"comments",
       [](const auto& text) {
         return "# c\n\n" + each_line(text, [](const auto& l) { return l + "\n# c"; });
       }},
      {"an empty file", [](const auto&) { return std::string(); }},
      {"one line",
       [](const auto& text) {
         std::string first;
         each_line(text, [&](const auto& l) { return first.empty() ? first = l : l; });
         return first + "\n";
       }},
      {"duplicates",
       [](const auto& text) { return each_line(text, [](const auto& l) { return l + "\n" + l; }); }},
      {"unsorted", [](const auto& text) {
         std::istringstream in(text);
         std::string backwards;
         for (std::string line; std::getline(in, line);) backwards = line + "\n" + backwards;
         return backwards;
       }}};
  return all;
}

struct TextFormat {
  std::string file;  ///< in the sequence's folder
  std::function<void(const fs::path&)> prepare;
  std::string command;
  /// What the program says of each of text_states(), in their order; an error begins with '!'.
  std::array<std::string, 9> says;
};

std::vector<TextFormat> text_formats() {
  const std::string run = "run SEQ --dynamics none --no-map --out OUT --max-frames 4",
                    read = "4 of 4 frames tracked", all = "8 of 8 frames tracked",
                    once = "1 of 1 frames tracked";
  const auto lists = [](const fs::path& root) { fs::remove(root / "associations.txt"); };
  const auto file = [](const char* name, std::string_view text) {
    return [=](const fs::path& root) { write_text(root / name, text); };
  };
  const auto list = [&](const char* name, const std::function<void(const fs::path&)>& prepare) {
    const std::string at = std::string(name) + ": ";
    return TextFormat{
        name,
        prepare,
        run,
        {read, read, read, read, read, "!" + at + "lists no images", once,
         at + "8 of 16 lines have the time of another one", at + "the lines are not sorted by time"}};
  };
  const std::string open = "1 of 1 jobs are not done", equal = "ATE [m]                 0.000000";
  return {
      list("rgb.txt", lists),
      list("depth.txt", lists),
      list("associations.txt", {}),
      {"groundtruth.txt",
       {},
       "run SEQ --dynamics none --no-map --out OUT",
       {"ATE [m]", "ATE [m]", "ATE [m]", "ATE [m]", "ATE [m]", "groundtruth.txt: holds no poses",
        "1 of 8 poses have one of the ground truth", all, all}},
      {"camera.txt",
       {},
       run,
       {read, read, "!camera.txt:1: unknown key", read, read, "!camera.txt: 'width' is missing",
        "!camera.txt: 'width' is missing", "!camera.txt:2: 'name' once more", read}},
      {"own.yaml",
       file("own.yaml",
            "image_width: 320\nimage_height: 240\nK: [267.7, 0, 159.8, 0, 269.6, 123.55, 0, 0, 1]\n"
            "depth_units_per_metre: 5000\n"),
       run + " --camera SEQ/own.yaml",
       {read, read, "!own.yaml:1: expected 'key: value'", read, read, "!own.yaml: 'width' is missing",
        "!own.yaml: 'camera_matrix' (or 'K') is missing", "!once more", read}},
      {"c.toml",
       file("c.toml", "seed = 3\nnu = 5\n"),
       run + " --config SEQ/c.toml",
       {read, read, "!c.toml:1: key-value pair: expected '=', saw ','", read, read, read, read,
        "!c.toml:2: key-value pair: cannot redefine existing integer 'seed'", read}},
      {"s.toml",
       file("s.toml", "sequences = [\".\"]\nmodes = [\"none\"]\n"),
       "sweep SEQ/s.toml --out OUT --gather",
       {"!" + open, "!" + open, "!s.toml:1: key-value pair: expected '=', saw ','", "!" + open, "!" + open,
        "!s.toml: sequences is missing", "!s.toml: modes is missing",
        "!s.toml:2: key-value pair: cannot redefine existing array 'sequences'", "!" + open}},
      {"estimate.txt",
       [](const fs::path& root) { fs::copy_file(root / "groundtruth.txt", root / "estimate.txt"); },
       "eval SEQ/estimate.txt SEQ/groundtruth.txt",
       {equal, equal, equal, equal, equal, "!estimate.txt: holds no poses",
        "!1 of 1 poses have one of the ground truth", equal, equal}}};
}

/// An image file of another kind than it was. @param grey  its values, CV_8UC1
void write_kind(const std::string& kind, const fs::path& file, const cv::Mat& grey) {
  PngPalette palette;
  for (int i = 0; i < 256; ++i)
    palette.push_back(
        {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i)});
  cv::Mat colours, wide;
  cv::cvtColor(grey, colours, cv::COLOR_GRAY2BGR);
  if (kind == "palette") return write_raw_png(file, grey, 8, palette);
  if (kind == "1 bit") return write_raw_png(file, grey / 128, 1, {});
  if (kind == "16-bit colour") {
    colours.convertTo(wide, CV_16UC3, 257);
    return write_image(file, wide);
  }
  if (kind == "alpha") {
    cv::merge(std::vector<cv::Mat>{grey, grey, grey, grey}, wide);
    return write_image(file, wide);
  }
  if (kind == "empty") return write_text(file, "");
  std::string header;  // "huge": a file of a few bytes that says so
  append_number(header, 100000);
  append_number(header, 100000);
  header += std::string("\x08\0\0\0\0", 5);
  write_text(file, std::string("\x89PNG\r\n\x1A\n", 8) + chunk("IHDR", header) +
                       chunk("IDAT", zlib_stored("")) + chunk("IEND", ""));
}

struct ImageRole {
  std::string name, command;
  /// What is said of a palette, 1 bit, 16-bit colour, alpha, huge, empty; an error begins with '!'.
  std::array<std::string, 6> says;
};

std::vector<ImageRole> image_roles() {
  const std::string run = "run SEQ --no-map --out OUT --max-frames 4 ", read = "4 of 4 frames tracked",
                    huge = "!is 100000x100000 pixels; at most 8192 a side are read", empty = "!png: is empty",
                    depth = "!is not a 16-bit image of one channel, as depth is, but has ";
  const std::string binary = "grey masks, dynamic where 128 or more";
  return {{"rgb", run + "--dynamics none", {read, read, read, read, huge, empty}},
          {"depth",
           run + "--dynamics none",
           {depth + "8 bits and 3 channels", depth + "8 bits and 1 channel", depth + "16 bits and 3 channels",
            depth + "8 bits and 4 channels", huge, empty}},
          {"masks",
           run + "--dynamics semantic --masks SEQ/masks",
           {binary, binary, binary, "alpha channel, dynamic where it is 128 or more", huge, empty}}};
}

std::vector<UserInput> network_rows() {
  const std::string run =
                        "run SEQ --no-map --out OUT --max-frames 2 --dynamics semantic -v --model SEQ/m.onnx",
                    masked = "2 classes named by its metadata; dynamic: person";
  const auto network = [](const std::function<void(ConstantNetwork&)>& change) {
    std::vector<float> classes = middle(48, 64, -5, 5);
    const std::vector<float> there = middle(48, 64, 5, -5);
    classes.insert(classes.end(), there.begin(), there.end());
    ConstantNetwork made{{{"out", {1, 2, 48, 64}, classes}}};
    made.metadata = {{"names", "{0: 'background', 1: 'person'}"}};
    change(made);
    return [made](const fs::path& root) { write_onnx(root / "m.onnx", made); };
  };
  constexpr int kInt8 = 3;
  return {
      {"a batch",
       network([](auto& n) {
         n.input = {2, 3, 48, 64};
       }),
       run,
       1,
       {"takes 2 images at once"}},
      {"dynamic axes",
       network([](auto& n) {
         n.input = {-1, 3, -1, -1};
       }),
       run,
       0,
       {masked}},
      {"fp16", network([](auto& n) { n.input_type = n.outputs[0].type = kOnnxHalf; }), run, 0, {masked}},
      {"int8", network([](auto& n) { n.input_type = kInt8; }), run, 1, {"has an input of type int8; float"}},
      {"NMS inside",
       network([](auto& n) {
         n.outputs = {{"out", {1, 300, 6}, {}}};
       }),
       run,
       1,
       {"a detector whose suppression is inside"}},
      {"several inputs",
       network([](auto& n) { n.further_inputs = {"size"}; }),
       run,
       1,
       {"has 2 inputs (image, size)"}},
      {"several heads",
       network([](auto& n) {
         n.outputs.push_back(n.outputs[0]);
         n.outputs[0].name = "one";
         n.outputs[1].name = "other";
       }),
       run,
       1,
       {"--model-output-name says which is"}},
      {"several heads, named",
       network([](auto& n) {
         n.outputs.push_back(n.outputs[0]);
         n.outputs[0].name = "one";
         n.outputs[1].name = "other";
       }),
       run + " --model-output-name other",
       0,
       {masked}},
      {"a pointer of Git LFS",
       [](const fs::path& root) {
         write_text(root / "m.onnx", "version https://git-lfs.github.com/spec/v1\n");
       },
       run,
       1,
       {"m.onnx: is the pointer that Git LFS leaves"}},
      {"a web page",
       [](const fs::path& root) { write_text(root / "m.onnx", "<html>404</html>"); },
       run,
       1,
       {"m.onnx: is a web page"}},
      {"PyTorch's file",
       [](const fs::path& root) { write_text(root / "m.onnx", "PK\x03\x04"); },
       run,
       1,
       {"m.onnx: is a zip file, as PyTorch's"}},
      {"nobody there",
       network([](auto& n) {
         n.outputs[0].values = middle(48, 64, 5, 5);  // of the background; of the person 0
         n.outputs[0].values.resize(2 * 48 * 64);
       }),
       run,
       0,
       {"no a-priori mask marks anything dynamic in any of 2 frames"}}};
}

}  // namespace

TEST_CASE("texts of every format are read in every state that files are found in, or refused in a line") {
  for (const TextFormat& format : text_formats()) {
    for (std::size_t k = 0; k < text_states().size(); ++k) {
      const bool refused = format.says[k].starts_with('!');
      check_row({format.file + ", " + std::string(text_states()[k].name),
                 [&](const fs::path& root) {
                   if (format.prepare) format.prepare(root);
                   write_text(root / format.file, text_states()[k].of(text_of(root / format.file)));
                 },
                 format.command,
                 refused ? 1 : 0,
                 {format.says[k].substr(refused ? 1 : 0)}});
    }
  }
}

TEST_CASE("images of every kind are read where colour, depth or a mask is expected, or refused in a line") {
  constexpr std::array kKinds{"palette", "1 bit", "16-bit colour", "alpha", "huge", "empty"};
  const cv::Mat mask = two_boxes({320, 240}, CV_8UC1, 255, 255);
  for (const ImageRole& role : image_roles()) {
    for (std::size_t k = 0; k < kKinds.size(); ++k) {
      const bool refused = role.says[k].starts_with('!');
      const auto change = [&](const fs::path& root) {
        fs::create_directories(root / role.name);
        for (const auto& file : fs::directory_iterator(root / "rgb")) {
          const cv::Mat grey =
              role.name == "masks" ? mask : cv::imread(file.path().string(), cv::IMREAD_GRAYSCALE);
          if (role.name != "depth") write_kind(kKinds[k], root / role.name / file.path().filename(), grey);
        }
        if (role.name != "depth") return;
        for (const auto& file : fs::directory_iterator(root / "depth")) {
          cv::Mat depth = cv::imread(file.path().string(), cv::IMREAD_UNCHANGED), grey;
          depth.convertTo(grey, CV_8UC1, 1.0 / 256);
          write_kind(kKinds[k], file.path(), grey);
        }
      };
      check_row({role.name + ", " + kKinds[k],
                 change,
                 role.command,
                 refused ? 1 : 0,
                 {role.says[k].substr(refused ? 1 : 0)}});
    }
  }
}

TEST_CASE("networks of every kind are run, or refused in a line") {
  if (!dynslam::runtime::has_onnxruntime()) {
    MESSAGE("skipped: built without ONNX Runtime, and OpenCV's dnn does not load these graphs");
    return;
  }
  for (const UserInput& row : network_rows()) check_row(row);
}
