// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/semantic/voxel.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "random.hpp"

using namespace dynslam;

namespace {
template <std::size_t N>
using Labels = std::integral_constant<std::size_t, N>;
}  // namespace

TEST_CASE_TEMPLATE("log-odds and probability invert each other and never become NaN (Eqs 10, 11)", S, float,
                   double) {
  for (const double p : {0.001, 0.12, 0.4, 0.5, 0.7, 0.97, 0.999}) {
    CHECK(static_cast<double>(log_odds_to_probability(probability_to_log_odds(S(p)))) ==
          doctest::Approx(p).epsilon(1e-5));
  }
  for (const S l : {S(100), S(1000), S(-100), S(-1000)}) {
    const S p = log_odds_to_probability(l);
    CHECK(std::isfinite(p));
    CHECK(p >= S(0));
    CHECK(p <= S(1));
  }
}

TEST_CASE("adding log-odds (Eq 12) equals Bayes' recursion on probabilities (Eq 9)") {
  test::Rng rng("bayes");
  for (int k = 0; k < 100; ++k) {
    double p = 0.5, l = 0;
    for (int i = 0; i < 12; ++i) {
      const double measurement = rng.uniform(0.1, 0.9);
      p = bayes_update(measurement, p, 0.5);
      l += probability_to_log_odds(measurement);
      CHECK(log_odds_to_probability(l) == doctest::Approx(p).epsilon(1e-9));
    }
  }
}

TEST_CASE_TEMPLATE("a cell is unknown, then free or occupied; it is clamped and can change its mind", S,
                   float, double) {
  const LogOddsParams<S> params;
  LogOddsCell<S> cell;
  CHECK(cell.state(params) == Occupancy::unknown);
  cell.update(params.miss, params);
  CHECK(cell.state(params) == Occupancy::free);
  for (int i = 0; i < 1000; ++i) cell.update(params.hit, params);
  CHECK(cell.state(params) == Occupancy::occupied);
  CHECK(static_cast<double>(cell.probability()) == doctest::Approx(0.97));
  int updates = 0;
  while (cell.state(params) == Occupancy::occupied) {
    cell.update(params.miss, params);
    ++updates;
  }
  CHECK(updates == 9);  // ln(0.97/0.03) / ln(0.6/0.4), rounded up
}

TEST_CASE_TEMPLATE("NaN is no measurement of a cell; certainty takes it to its bounds and no farther", S,
                   float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN(), inf = std::numeric_limits<S>::infinity();
  const LogOddsParams<S> params;
  LogOddsCell<S> cell;
  cell.update(nan, params);
  CHECK(cell.state(params) == Occupancy::unknown);
  cell.update(params.hit, params);
  cell.update(probability_to_log_odds(S(1.5)), params);  // no probability
  CHECK(cell.log_odds() == params.hit);
  CHECK(cell.state(params) == Occupancy::occupied);
  cell.update(probability_to_log_odds(S(0)), params);
  CHECK(cell.log_odds() == params.min);
  CHECK(cell.state(params) == Occupancy::free);
  cell.update(inf, params);
  CHECK(cell.log_odds() == params.max);
  CHECK(cell.state(params) == Occupancy::occupied);
  // Without bounds opposite certainties contradict each other: the later one says nothing.
  LogOddsParams<S> unbounded;
  unbounded.min = -inf;
  unbounded.max = inf;
  LogOddsCell<S> certain;
  certain.update(inf, unbounded);
  certain.update(-inf, unbounded);
  CHECK(certain.state(unbounded) == Occupancy::occupied);
}

TEST_CASE("updates commute before clamping") {
  const LogOddsParams<double> params;
  LogOddsCell<double> a, b;
  for (const double l : {params.hit, params.miss, params.miss}) a.update(l, params);
  for (const double l : {params.miss, params.hit, params.miss}) b.update(l, params);
  CHECK(a.log_odds() == doctest::Approx(b.log_odds()).epsilon(1e-12));
}

TEST_CASE("labels are votes: bounded, mergeable, ties to the smaller label") {
  LabelHistogram<4> h;
  CHECK(h.top() == 0);
  CHECK(h.confidence() == 0.0);
  h.add(2);
  h.add(3);
  CHECK(h.top() == 2);
  h.add(3);
  CHECK(h.top() == 3);
  CHECK(h.confidence() == doctest::Approx(2.0 / 3.0));
  h.add(9);  // no such label
  CHECK(h.total() == 3);
  for (int i = 0; i < 10000; ++i) h.add(1);
  CHECK(h.top() == 1);
  CHECK(h.total() < 300);
  for (int i = 0; i < 300; ++i) h.add(2);  // new evidence wins in bounded time
  CHECK(h.top() == 2);
  LabelHistogram<4> sum;
  for (int i = 0; i < 200; ++i) sum.add(3);
  LabelHistogram<4> other = sum;
  other.add(1);
  sum.merge(other);
  CHECK(sum.top() == 3);
  CHECK(sum.votes(3) == 200);
}

TEST_CASE("votes saturate instead of wrapping around") {
  LabelHistogram<4> h;
  h.add(1, 255);
  h.add(1, 200);  // was 71
  CHECK(h.votes(1) == 255);
  h.add(2, 1000);
  CHECK(h.votes(2) == 255);
  CHECK(h.top() == 1);
  h.add(2, 0);
  CHECK(h.votes(2) == 255);
}

TEST_CASE_TEMPLATE("the number of labels is a parameter; none of them vanishes", N, Labels<4>, Labels<8>,
                   Labels<80>, Labels<256>) {
  for (std::size_t l = 0; l < N::value; ++l) {
    LabelHistogram<N::value> h;
    h.add(static_cast<std::uint8_t>(l), 3);
    CHECK(h.top() == l);
    CHECK(h.total() == 3);
  }
  CHECK(sizeof(LabelHistogram<N::value>) == N::value);
}

TEST_CASE("a tie is the smallest label's, and 0, which is none, never wins one") {
  LabelHistogram<4> h({5, 2, 5, 5});
  CHECK(h.top() == 2);
  CHECK(LabelHistogram<4>({6, 2, 5, 5}).top() == 0);
  CHECK(LabelHistogram<4>({0, 0, 0, 0}).top() == 0);
  CHECK(LabelHistogram<1>(std::array<std::uint8_t, 1>{3}).top() == 0);
  // Sums that rounding makes equal keep their order.
  test::Rng rng("ties of sums");
  for (int trial = 0; trial < 500; ++trial) {
    std::array<int, 4> sums{};
    for (int& sum : sums) sum = rng.integer(0, 1) * rng.integer(0, 30);
    std::size_t most = 0;
    for (std::size_t i = 1; i < 4; ++i)
      if (sums[i] > sums[most] || (most == 0 && sums[i] == sums[0] && sums[i] > 0)) most = i;
    CHECK(LabelHistogram<4>::from_sums(sums, 8).top() == most);
  }
}

TEST_CASE("a voxel joins occupancy and label") {
  const LogOddsParams<float> params;
  SemanticVoxel<float, 4> voxel;
  voxel.hit(2, params);
  voxel.hit(2, params);
  voxel.hit(0, params);
  voxel.miss(params);
  CHECK(voxel.occupancy.state(params) == Occupancy::occupied);
  CHECK(voxel.labels.top() == 2);
}
