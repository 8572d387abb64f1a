// SPDX-License-Identifier: BSD-3-Clause
// Which of the system's additions a method and a mode take.
#include "dynslam/runtime/slam/dynamics_mode.hpp"

#include <doctest/doctest.h>

#include <array>
#include <bit>
#include <cstddef>
#include <set>
#include <string_view>
#include <type_traits>

#include "dynslam/runtime/evaluation/ablate.hpp"

using namespace dynslam::runtime;

namespace {

constexpr std::array kModes{DynamicsMode::none, DynamicsMode::semantic, DynamicsMode::geometric,
                            DynamicsMode::both};

/// The fields by their bytes, of which no list of names knows.
constexpr std::array<unsigned char, sizeof(Additions)> switches_of(const Additions& a) {
  return std::bit_cast<std::array<unsigned char, sizeof(Additions)>>(a);
}
template <class... Values>
constexpr bool takes_a_list = requires(Values... values) {
  Additions{values...};
};

}  // namespace

TEST_CASE("none of the additions is none, and all are all, whatever fields there are") {
  for (const unsigned char field : switches_of(Additions::none())) CHECK(field == 0);
  for (const unsigned char field : switches_of(Additions::all())) CHECK(field == 1);
  // The list names each field once.
  std::set<std::string_view> names;
  std::set<std::size_t> fields;
  for (const Addition& one : kAdditions) {
    names.insert(one.name);
    Additions a;
    a.*one.on = true;
    const auto bytes = switches_of(a);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      if (bytes[i] != 0) fields.insert(i);
    }
  }
  CHECK(names.size() == sizeof(Additions));
  CHECK(fields.size() == sizeof(Additions));
}

TEST_CASE("additions are switched on by name: a list of values, which may be short, does not compile") {
  static_assert(!std::is_aggregate_v<Additions>);
  CHECK_FALSE(takes_a_list<bool>);
  CHECK_FALSE(takes_a_list<bool, bool, bool, bool>);
  CHECK_FALSE(takes_a_list<bool, bool, bool, bool, bool, bool, bool, bool>);
  CHECK(takes_a_list<>);
}

TEST_CASE("the paper's method takes no addition, in run and in ablate; none is the baseline of run") {
  for (const DynamicsMode mode : kModes) CHECK(additions(MotionMethod::paper, mode) == Additions::none());
  CHECK(ablation_additions(MotionMethod::paper) == Additions::none());
  CHECK(additions(MotionMethod::full, DynamicsMode::none) == Additions::none());
}

TEST_CASE("the full method takes what a mode can use") {
  Additions both = Additions::all();
  both.proven_points = false;
  CHECK(additions(MotionMethod::full, DynamicsMode::both) == both);
  CHECK(additions(MotionMethod::full, DynamicsMode::geometric) == both);
  CHECK(ablation_additions(MotionMethod::full) == both);
  Additions semantic = both;
  semantic.strict_local_map = false;
  CHECK(additions(MotionMethod::full, DynamicsMode::semantic) == semantic);
}
