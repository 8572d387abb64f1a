// SPDX-License-Identifier: BSD-3-Clause
// The configuration file: every field of the options, printed, read, and with an effect.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "config/field_list.hpp"
#include "dynslam/runtime/config/options_file.hpp"
#include "error_text.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
using test::error_of, test::mentions;

namespace {

/// Options with their fields.
struct Configured {
  RunOptions options;
  std::optional<DynamicsMode> dynamics;
  ConfigFields fields = config_fields(options, dynamics);
  Configured() = default;
  Configured(const Configured&) = delete;
  Configured& operator=(const Configured&) = delete;

  std::vector<std::string> read(const std::string& text) {
    std::istringstream in(text);
    return read_config(in, "c.toml", fields);
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
  void operator()(std::optional<double>* v) const { *v = 0.1 + 0.02; }  // in every range, with many digits
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
  Configured again;
  again.read(config_file(defaults.fields));
  check_equal(again, defaults);
}

TEST_CASE("at most 60 fields are a user's, each of them exists, and a file of defaults names no other one") {
  const Configured c;
  std::set<std::string> user, tuning;
  for (const ConfigField& field : c.fields) (field.tuning ? tuning : user).insert(field.name());
  CHECK(user.size() <= 60);
  CHECK(tuning.size() > 200);
  const auto names = config::user_field_names();
  CHECK(user == std::set<std::string>(names.begin(), names.end()));
  CHECK(names.size() == user.size());

  const auto names_in = [](const std::string& text) {
    std::set<std::string> found;
    std::istringstream in(text);
    std::string table;
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with('[')) table = line.substr(1, line.size() - 2);
      if (const auto equals = line.find(" = "); equals != std::string::npos && !line.starts_with('#'))
        CHECK(found.insert(table + '.' + line.substr(0, equals)).second);
    }
    return found;
  };
  CHECK(names_in(config_file(c.fields)) == user);
  CHECK(names_in(tuning_file(c.fields)) == tuning);
  CHECK(mentions(tuning_file(c.fields), "no promise"));
}

TEST_CASE("of the tuning fields, a run's configuration holds those that differ from their defaults") {
  Configured c, read;
  c.read("[tracker.search]\nmin_inliers = 31\nmax_turn = 7.5\n[tracker.features]\nlevels = 8\n");
  const std::string text = config_file(c.fields);
  CHECK(mentions(text, "\nmin_inliers = 31\n"));
  CHECK_FALSE(mentions(text, "\nlevels = "));  // its default
  CHECK_FALSE(mentions(text, "\nweak_inliers = "));
  CHECK(text.find("\nmax_turn = 7.5\n") < text.find("# -- tuning fields"));
  CHECK(text.find("# -- tuning fields") < text.find("\nmin_inliers = 31\n"));
  CHECK(text.find("[tracker.search]") == text.rfind("[tracker.search]"));  // TOML allows a table once
  read.read(text);
  check_equal(read, c);
}

TEST_CASE("fields of earlier versions have no effect, and a line says so") {
  Configured read;
  const auto notes = read.read(
      "[tracker.geometry.free_space]\ncarry = 10\ntiming = 0.2\n[tracker.geometry.growing]\nwhole = 0.5\nmax_hole = 9\n"
      "[tracker.search]\naside = 5.0\n");
  REQUIRE(notes.size() == 3);
  CHECK(mentions(notes[0], "c.toml:1: [tracker.geometry.free_space] has no effect any more"));
  CHECK(mentions(notes[1], "c.toml:5: tracker.geometry.growing.whole has no effect any more"));
  CHECK(mentions(notes[2], "c.toml:8: tracker.search.aside has no effect any more"));
  CHECK(read.options.tracker.geometry.growing.max_hole == 9);
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
           Wrong{"[tracker.pose]\nnu = 5 6\n", "nu: expected a finite number, above 0, not \"5 6\""},
           Wrong{"[tracker.pose]\nnu = # none\n", "c.toml:2: key-value pair: expected value, saw '#'"},
           Wrong{"[general]\nseed = -1\n", "seed: expected a whole number from 0, not -1"},
           Wrong{"[general]\nmap = yes\n", "map: expected true or false, not \"yes\""},
           Wrong{"[general]\nmap = 1\n", "map: expected true or false, not 1"},
           Wrong{"[general]\ncamera = \"fr3\n", "c.toml:2: the closing quote is missing"},
           Wrong{"[general]\nmap = true\nseed = 1\nmap = false\n",
                 "c.toml:4: key-value pair: cannot redefine existing boolean 'map'"},
           Wrong{"[general]\ndynamics = \"magic\"\n",
                 "expected one of \"auto\", \"none\", \"semantic\", \"geometric\", \"both\", not \"magic\""},
           Wrong{"[tracker]\nadditions = [\"motion_prior\"]\n",
                 "expected one of \"auto\", \"none\", \"all\""},
           Wrong{"[tracker.geometry.belief.free_space]\nlags = [0.1, 0.2]\n",
                 "expected an array of 7 numbers"},
           Wrong{"[segmentation.segmenter]\ninput = [640,\n", "c.toml:2: array: encountered end-of-file"},
           Wrong{"[general]\ncamera = \"a\\u0000b\"\n", "c.toml:2: general.camera has a NUL character"},
           Wrong{"\n\"ma\\u0000sks\" = 1\n", "c.toml:2: ma\\x00sks has a NUL character"},
           Wrong{"[segmentation.segmenter]\ndynamic_classes = [\"a\", \"\\u0000\"]\n",
                 "c.toml:2: segmentation.segmenter.dynamic_classes has a NUL character"},
           Wrong{"[general\n", "c.toml:1: table header: expected ']', saw '\\n'"},
           Wrong{"[general]\nmap\n", "c.toml:2: key-value pair: expected '=', saw '\\n'"},
       }) {
    Configured c;
    const std::string message = error_of([&] { c.read(wrong.text); });
    CAPTURE(message);
    CHECK(mentions(message, wrong.message));
  }
}

TEST_CASE("what TOML allows is understood") {
  Configured c;
  c.read(
      "tracker.search.min_inliers = 1_000 # dotted, at the top\ntracker.features.scale_factor = 1.01\n[ "
      "tracker.geometry.weights ]# comment\n"
      "tau = +2.5e-1\nnumerator = 12\nfloors.depth = 3\n[segmentation.segmenter]\n"
      "dynamic_classes = ['per#son', # one\n\n  \"a\\\"b\\u0041\",\n]\nmodel = 'a\\b'\r\n[ "
      "tracker.local_bundle ]\n"
      "window = 0x1f\n");
  CHECK(c.options.tracker.search.min_inliers == 1000);
  CHECK(c.options.tracker.geometry.weights.tau == 0.25);
  CHECK(c.options.tracker.features.scale_factor == 1.01F);  // a bound
  CHECK(c.options.tracker.geometry.weights.numerator == 12.0);
  CHECK(c.options.tracker.geometry.weights.floors.depth == 3.0);
  CHECK(c.options.segmentation.segmenter.dynamic_classes == std::vector<std::string>{"per#son", "a\"bA"});
  CHECK(c.options.segmentation.segmenter.model == "a\\b");
  CHECK(c.options.tracker.local_bundle.window == 31);
}

TEST_CASE("numbers keep all their digits: floats and doubles of any bits, seeds of 64 bits") {
  std::mt19937_64 random(3);
  const auto check_bits = [&]<class T, class Bits>(T, Bits) {
    T value{}, read{};
    ConfigField written, field;
    written.value = &value;
    field.value = &read;
    for (int i = 0; i < 4000; ++i) {
      value = std::bit_cast<T>(static_cast<Bits>(random()));
      if (!std::isfinite(value)) continue;
      CHECK(set_config(field, config_text(written)).empty());
      CHECK(std::bit_cast<Bits>(read) == std::bit_cast<Bits>(value));
    }
  };
  check_bits(float(), std::uint32_t());
  check_bits(double(), std::uint64_t());
  Configured c, again;
  c.options.seed = std::numeric_limits<std::uint64_t>::max();
  again.read(config_file(c.fields));
  CHECK(again.options.seed == c.options.seed);
}

TEST_CASE("a value that is no TOML counts as text; a name in quotes is none of several") {
  Configured c;
  c.read("[general]\ndynamics = both # bare\ncamera = /a/b#c.txt # comment\n");
  CHECK(c.options.camera == "/a/b#c.txt");
  CHECK(c.dynamics == DynamicsMode::both);
  CHECK(mentions(error_of([&] { c.read("\"general.camera\" = 'fr1'\n"); }), "c.toml:1: "));
  c.read("general.camera = \xC3\xA9t\xC3\xA9.txt\n");  // U+00E9, of which toml++ 3.3 asks whether it is a space
  CHECK(c.options.camera == "\xC3\xA9t\xC3\xA9.txt");
  for (const char* table : {"[&]", "[[%b]]", "[\xC3\xA9t\xC3\xA9]"})  // an assertion of toml++ 3.3
    CHECK(mentions(error_of([&] { c.read(fmt::format("general.seed = 7\n\n{}\nseed = 8\n", table)); }),
                   "c.toml:3: expected a name"));
  std::string deep = "a";
  for (int i = 0; i < 100000; ++i) deep += ".a";
  for (const std::string& text : {deep + " = 1\n", "[" + deep + "]\n"})
    CHECK(mentions(error_of([&] { c.read("\n" + text); }), "c.toml:2: has too many dots"));
}
