// SPDX-License-Identifier: BSD-3-Clause
// The configuration file: every field of the options, printed, read, and with an effect.
#include <doctest/doctest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>
#include <string>

#include "dynslam/runtime/config/options_file.hpp"
#include "error_text.hpp"
#include "program.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::bytes, test::call, test::error_of, test::mentions;

namespace {

/// Options with their fields.
struct Configured {
  RunOptions options;
  std::optional<DynamicsMode> dynamics;
  ConfigFields fields = config_fields(options, dynamics);
  Configured() = default;
  Configured(const Configured&) = delete;
  Configured& operator=(const Configured&) = delete;

  void read(const std::string& text) {
    std::istringstream in(text);
    read_config(in, "c.toml", fields);
  }
};

/// Another value that the field may have; numbers with as many digits as their type has.
struct OtherValue {
  const ConfigRange& range;

  template <class T>
  [[nodiscard]] T number(T value) const {
    for (const double factor : {1.1, 0.9, -0.7}) {
      T other{};
      if constexpr (std::is_integral_v<T>) {
        other = static_cast<T>(factor > 1 ? value + 1 : value - 1);
      } else {
        other = std::nextafter(static_cast<T>(factor * static_cast<double>(value) + 0.013), T(-1));
      }
      if (other != value && range.holds(static_cast<double>(other))) return other;
    }
    FAIL("no other value");
    return value;
  }
  void operator()(bool* v) const { *v = !*v; }
  template <class T>
    requires std::is_arithmetic_v<T>
  void operator()(T* v) const { *v = number(*v); }
  void operator()(std::string* v) const { *v = "a \"b\" # \\ c' \t\x01 \xc3\xa9"; }
  void operator()(std::filesystem::path* v) const { *v = "fol der/é=#\"'.onnx"; }
  void operator()(std::vector<std::string>* v) const { *v = {"traffic light", "a, b]", ""}; }
  void operator()(std::span<double> v) const {
    for (double& one : v) one = number(one);
  }
  void operator()(cv::Size* v) const { *v = {number(v->width), number(v->height)}; }
  void operator()(std::optional<double>* v) const { *v = 0.1 + 0.2; }
  void operator()(std::optional<Additions>* v) const { *v = Additions{false, true, false, true}; }
  void operator()(const ConfigChoice& v) const {
    v.set(v.get() == v.names.back() ? v.names.front() : v.names.back());
  }
};

/// Where a field's value is.
const void* address(const ConfigValue& value) {
  return std::visit(
      [](const auto& v) -> const void* {
        using V = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<V, ConfigChoice>) {
          return v.object;
        } else if constexpr (std::is_same_v<V, std::span<double>>) {
          return v.data();
        } else {
          return v;
        }
      },
      value);
}

void check_equal(const Configured& a, const Configured& b) {
  REQUIRE(a.fields.size() == b.fields.size());
  for (std::size_t i = 0; i < a.fields.size(); ++i) {
    CAPTURE(a.fields[i].name());
    CHECK(config_text(a.fields[i]) == config_text(b.fields[i]));
    if (const auto* of_a = std::get_if<double*>(&a.fields[i].value))
      CHECK(**of_a == **std::get_if<double*>(&b.fields[i].value));
    if (const auto* of_a = std::get_if<float*>(&a.fields[i].value))
      CHECK(**of_a == **std::get_if<float*>(&b.fields[i].value));
  }
}

}  // namespace

TEST_CASE("a printed configuration reads back the same: defaults, and every field changed") {
  Configured defaults, changed, read;
  REQUIRE(defaults.fields.size() > 200);
  std::set<const void*> places;
  for (ConfigField& field : changed.fields) {
    CAPTURE(field.name());
    CHECK(places.insert(address(field.value)).second);  // no field stands for another one's value
    CHECK_FALSE(field.meaning.empty());
    const std::string before = config_text(field);
    ConfigValue value = field.value;
    std::visit(OtherValue{field.range}, value);
    CHECK(config_text(field) != before);
  }
  read.read(config_file(changed.fields));
  check_equal(read, changed);
  read.read(config_file(defaults.fields));
  check_equal(read, defaults);
}

TEST_CASE("a configuration's mistakes are named with file, line, what was expected and the nearest name") {
  struct Wrong {
    const char *text, *message;
  };
  for (const Wrong& wrong : {
           Wrong{"[tracker.search]\nmin_inlier = 3\n",
                 "c.toml:2: unknown key 'min_inlier' in [tracker.search], did you mean min_inliers?"},
           Wrong{"\n[trakcer.search]\n",
                 "c.toml:2: unknown table [trakcer.search], did you mean [tracker.search]?"},
           Wrong{"[local_bundle]\n", "unknown table [local_bundle], did you mean [tracker.local_bundle]?"},
           Wrong{"[tracker]\nlevels = 3\n",
                 "c.toml:2: unknown key 'levels' in [tracker], did you mean levels of "
                 "[tracker.features]?"},
           Wrong{"[tracker.features]\nlevels = 40\n",
                 "c.toml:2: tracker.features.levels: expected a whole number, 1 to 32, not 40"},
           Wrong{"[tracker.features]\nlevels = 4.5\n", "expected a whole number, 1 to 32, not 4.5"},
           Wrong{"[tracker.features]\nlevels = \"8\"\n", "expected a whole number, 1 to 32, not \"8\""},
           Wrong{"[tracker.pose]\nnu = nan\n", "nu: expected a finite number, above 0, not nan"},
           Wrong{"[tracker.pose]\nnu = inf\n", "nu: expected a finite number, above 0, not inf"},
           Wrong{"[tracker.pose]\nnu = 1e400\n", "expected a finite number"},
           Wrong{"[tracker.pose]\nnu = 5 6\n", "nu: '6' follows the value"},
           Wrong{"[tracker.pose]\nnu = # none\n", "nu: a value is missing"},
           Wrong{"[general]\nseed = -1\n", "seed: expected a whole number from 0, not -1"},
           Wrong{"[general]\nmap = yes\n", "map: 'yes' is no value; text stands in quotes"},
           Wrong{"[general]\nmap = 1\n", "map: expected true or false, not 1"},
           Wrong{"[general]\ncamera = \"fr3\n", "camera: the closing \" is missing"},
           Wrong{"[general]\nmap = true\nseed = 1\nmap = false\n", "c.toml:4: 'general.map' is given twice"},
           Wrong{"[general]\ndynamics = \"magic\"\n",
                 "expected one of \"auto\", \"none\", \"semantic\", \"geometric\", \"both\", not \"magic\""},
           Wrong{"[tracker]\nadditions = [\"magic\"]\n", "expected \"auto\" or an array of surface_weights"},
           Wrong{"[tracker.geometry.free_space]\nlags = [0.1, 0.2]\n", "expected an array of 7 numbers"},
           Wrong{"[segmentation.segmenter]\ninput = [640,\n", "the closing ] is missing on this line"},
           Wrong{"[general\n", "c.toml:1: expected [table]"},
           Wrong{"[general]\nmap\n", "c.toml:2: expected 'option = value'"},
       }) {
    Configured c;
    const std::string message = error_of([&] { c.read(wrong.text); });
    CAPTURE(message);
    CHECK(mentions(message, wrong.message));
  }
}

TEST_CASE("what TOML allows on one line is understood") {
  Configured c;
  c.read(
      "tracker.search.min_inliers = 1_000 # dotted, at the top\ntracker.features.scale_factor = 1.01\n[ "
      "tracker.geometry.weights ]# comment\n"
      "tau = +2.5e-1\nnumerator = 12\nfloors.depth = 3\n[segmentation.segmenter]\n"
      "dynamic_classes = ['per#son', \"a\\\"b\\u0041\",]\nmodel = 'a\\b'\r\n");
  CHECK(c.options.tracker.search.min_inliers == 1000);
  CHECK(c.options.tracker.geometry.weights.tau == 0.25);
  CHECK(c.options.tracker.features.scale_factor == 1.01F);  // a bound
  CHECK(c.options.tracker.geometry.weights.numerator == 12.0);
  CHECK(c.options.tracker.geometry.weights.floors.depth == 3.0);
  CHECK(c.options.segmentation.segmenter.dynamic_classes == std::vector<std::string>{"per#son", "a\"bA"});
  CHECK(c.options.segmentation.segmenter.model == "a\\b");
}

#ifdef DYNSLAM_PROGRAM
TEST_CASE("dynslam config prints a file that it reads as the same, with options and tables of a file") {
  const test::TemporaryFolder folder;
  const std::string path = folder.path.string(), file = path + "/c.toml", other = path + "/d.toml";
  REQUIRE(test::shell(std::string(DYNSLAM_PROGRAM) + " config > " + file).code == 0);
  CHECK(call("config " + file).out == bytes(file));
  std::ofstream(other) << "[run]\nmax-frames = 3\nsave-masks = true\nfeatures = 600\ndynamics = none\n"
                          "[tracker.features]\nfeatures = 700\nlevels = 6\n[eval]\njson = true\n";
  const test::ProgramResult shown = call("config " + other);
  CHECK(shown.code == 0);
  for (const char* line : {"\nmax_frames = 3\n", "\nsave_masks = true\n", "\nfeatures = 600\n",
                           "\nlevels = 6\n", "\ndynamics = \"none\"\n"})
    CHECK(mentions(shown.out, line));
  CHECK(mentions(call("eval --config " + other + " " + file + " " + file).out, "c.toml:3: expected 8"));

  std::ofstream(other) << "[tracker.pose]\nnu = 5\nnnu = 5\n";
  const std::string error =
      "dynslam: error: " + other + ":3: unknown key 'nnu' in [tracker.pose], did you mean nu?\n";
  for (const std::string& command : {"config " + other, "run " + path + " --config " + other,
                                     "ablate --config " + other + " " + path, "eval a b --config " + other}) {
    const test::ProgramResult r = call(command);
    CHECK(r.code == 1);
    CHECK(r.out == error);
  }
}

TEST_CASE(
    "a run from its own config.toml gives the same bytes, and one changed field changes what it should") {
  const test::WalkingSequence sequence(12);
  const test::TemporaryFolder folder;
  const auto run = [&](const std::string& name, const std::string& arguments) {
    const test::ProgramResult r =
        call("run " + sequence.path.string() + " --out " + (folder.path / name).string() + " " + arguments);
    CAPTURE(r.out);
    REQUIRE(r.code == 0);
    return folder.path / name;
  };
  const auto written = folder.path / "c.toml";
  std::ofstream(written) << "[run]\nseed = 5\n[tracker.features]\nfeatures = 700\n[mapper.scan]\n"
                            "pixel_stride = 3\n[tracker.search]\nprior_speed = 0.7\n";
  const auto first = run("first", "--nu 4.3 --config " + written.string());
  const std::string config = bytes(first / "config.toml");
  for (const char* line : {"\nseed = 5\n", "\nfeatures = 700\n", "\npixel_stride = 3\n", "\nnu = 4.3\n",
                           "\ndynamics = \"geometric\"\n"})
    CHECK(mentions(config, line));

  const auto again = run("again", "--config " + (first / "config.toml").string());
  for (const char* file : {"trajectory.txt", "keyframes.txt", "map.sot", "config.toml"}) {
    CAPTURE(file);
    CHECK(bytes(again / file) == bytes(first / file));
  }
  const auto changed = [&](const std::string& name, const std::string& from, const std::string& to) {
    std::string text = config;
    const auto at = text.find(from);
    REQUIRE(at != std::string::npos);
    std::ofstream(written) << text.replace(at, from.size(), to);
    return run(name, "--config " + written.string());
  };
  const auto map = changed("map", "\npixel_stride = 3\n", "\npixel_stride = 4\n");
  CHECK(bytes(map / "trajectory.txt") == bytes(first / "trajectory.txt"));
  CHECK(bytes(map / "map.sot") != bytes(first / "map.sot"));
  const auto features = changed("features", "\nfeatures = 700\n", "\nfeatures = 400\n");
  CHECK(bytes(features / "trajectory.txt") != bytes(first / "trajectory.txt"));
  const auto command_line = run("line", "--features 400 --config " + (first / "config.toml").string());
  CHECK(bytes(command_line / "trajectory.txt") == bytes(features / "trajectory.txt"));
}
#endif
