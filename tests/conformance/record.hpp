// SPDX-License-Identifier: BSD-3-Clause
// Results of one instantiation, by name, to be compared with those of another one.
#pragma once

#include <doctest/doctest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"

namespace dynslam::test {

template <Scalar S>
class Record {
 public:
  void put(std::string name, const S& value) { entries_.emplace_back(std::move(name), value); }
  template <class D>
  void put(const std::string& name, const Eigen::MatrixBase<D>& values) {
    for (Eigen::Index c = 0; c < values.cols(); ++c) {
      for (Eigen::Index r = 0; r < values.rows(); ++r)
        put(name + "(" + std::to_string(r) + "," + std::to_string(c) + ")", S(values(r, c)));
    }
  }
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] const std::string& name(std::size_t i) const { return entries_[i].first; }
  [[nodiscard]] const S& value(std::size_t i) const {
    DYNSLAM_ASSERT(i < entries_.size(), "a result that there is");
    return entries_[i].second;
  }

 private:
  std::vector<std::pair<std::string, S>> entries_;
};

/// How far two numbers are apart, as a share of the expected one where that is above 1; 0 where both are
/// infinite or none is a number.
[[nodiscard]] inline double distance_of(double value, double expected) {
  if (value == expected || (std::isnan(value) && std::isnan(expected))) return 0;
  const double d = std::abs(value - expected) / std::max(1.0, std::abs(expected));
  return std::isnan(d) ? std::numeric_limits<double>::infinity() : d;
}

/// The plain numbers of a record are those of the reference.
template <Scalar S, Scalar R>
void check_same(const Record<S>& found, const Record<R>& expected, double tolerance) {
  REQUIRE(found.size() == expected.size());
  REQUIRE(found.size() > 0);
  for (std::size_t i = 0; i < found.size(); ++i) {
    CAPTURE(found.name(i));
    CAPTURE(to_double(found.value(i)));
    CAPTURE(to_double(expected.value(i)));
    REQUIRE(found.name(i) == expected.name(i));
    CHECK(distance_of(to_double(found.value(i)), to_double(expected.value(i))) <= tolerance);
  }
}

}  // namespace dynslam::test
