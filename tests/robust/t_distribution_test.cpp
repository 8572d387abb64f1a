// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/robust/t_distribution.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <type_traits>
#include <unsupported/Eigen/AutoDiff>

#include "dynslam/robust/kernels.hpp"
#include "dynslam/robust/rho_sum.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// Student's t: normal over the root of an independent chi-square over nu.
double student(test::Rng& rng, int nu, double sigma) {
  double chi2 = 0;
  for (int i = 0; i < nu; ++i) {
    const double n = rng.normal();
    chi2 += n * n;
  }
  return sigma * rng.normal() / std::sqrt(chi2 / nu);
}

template <class Kernel>
void check_weight_is_slope(const Kernel& kernel) {
  for (const double s : {1e-6, 0.01, 0.5, 1.0, 1.7, 4.0, 10.0, 30.0, 1000.0}) {
    const double h = 1e-6 * (1 + s);
    const double slope = (kernel.rho(s + h) - kernel.rho(s - h)) / (2 * h);
    CAPTURE(s);
    CHECK(kernel.weight(s) == doctest::Approx(slope).epsilon(1e-5).scale(0.01));
    CHECK(kernel.rho(s) >= 0);
  }
}

}  // namespace

TEST_CASE("every kernel's weight is the derivative of its rho") {
  check_weight_is_slope(TDistribution<double>::with_dimension(5, 1));
  check_weight_is_slope(TDistribution<double>::paper());
  check_weight_is_slope(TDistribution<double>::with_dimension(5.0, 3));
  check_weight_is_slope(SquaredLoss<double>{});
  check_weight_is_slope(Huber<double>{});
  check_weight_is_slope(Cauchy<double>{});
  check_weight_is_slope(Tukey<double>{});
}

TEST_CASE_TEMPLATE("the logarithm of a product is the sum of logarithms", S, float, double) {
  const auto kernel = TDistribution<S>::with_dimension(S(5), 3);
  // The sum over residuals as they are, and so large that a few of them overflow what a number holds.
  for (const double size : {0.0, 1e-4, 1.0, 1e8, 1e17}) {
    test::Rng rng("sum of rho");
    RhoSum<S, TDistribution<S>> sum(kernel);
    double expected = 0;
    for (int i = 0; i < 3000; ++i) {
      const S s = static_cast<S>(size * rng.uniform(0, 1));
      sum.add(s);
      expected += 8.0 * std::log1p(static_cast<double>(s) / 5.0);
    }
    CAPTURE(size);
    CHECK(static_cast<double>(sum.value()) ==
          doctest::Approx(expected).epsilon(std::is_same_v<S, float> ? 1e-4 : 1e-12));
  }
  RhoSum<S, TDistribution<S>> infinite(kernel), undefined(kernel);
  for (const S s : {S(1), std::numeric_limits<S>::infinity(), S(1)}) infinite.add(s);
  for (const S s : {S(1), std::numeric_limits<S>::quiet_NaN(), S(1)}) undefined.add(s);
  CHECK(infinite.value() == std::numeric_limits<S>::infinity());
  CHECK(std::isnan(undefined.value()));
}

TEST_CASE_TEMPLATE("kernels without a logarithm are summed one by one", S, float, double) {
  const Huber<S> huber;
  RhoSum<S, Huber<S>> sum(huber);
  S expected = S(0);
  for (const S s : {S(0.5), S(1), S(40)}) {
    sum.add(s);
    expected += huber.rho(s);
  }
  CHECK(sum.value() == expected);
}

TEST_CASE("the same derivative with dual numbers, exactly") {
  using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, 1, 1>>;
  const auto kernel = TDistribution<Dual>::with_numerator(Dual(5.0), Dual(8.0));
  const auto plain = TDistribution<double>::with_numerator(5.0, 8.0);
  for (const double s : {0.0, 0.3, 4.0, 100.0}) {
    CHECK(kernel.rho(Dual(s, 1, 0)).derivatives()(0) == doctest::Approx(plain.weight(s)).epsilon(1e-12));
  }
}

TEST_CASE_TEMPLATE("Eq (4): the paper's figures", S, float, double) {
  const auto paper = TDistribution<S>::paper();
  CHECK(paper.weight(S(0)) == doctest::Approx(12.0 / 11.0));
  CHECK(paper.weight(S(1)) == doctest::Approx(1.0));
  CHECK(paper.weight(S(9)) == doctest::Approx(0.6));
  CHECK(TDistribution<S>::with_dimension(S(5), 3).weight(S(3)) == doctest::Approx(1.0));  // numerator nu + d
}

TEST_CASE_TEMPLATE("the scale of t-distributed residuals is recovered", S, float, double) {
  test::Rng rng("scale");
  for (const int nu : {3, 5, 11}) {
    for (const double sigma : {0.02, 1.0, 40.0}) {
      std::vector<S> r;
      for (int i = 0; i < 20000; ++i) r.push_back(static_cast<S>(student(rng, nu, sigma)));
      const auto estimate = estimate_scale<S>(std::span<const S>(r), S(nu));
      REQUIRE(estimate);
      CHECK(static_cast<double>(*estimate) == doctest::Approx(sigma).epsilon(0.04));
    }
  }
}

TEST_CASE("moving points do not inflate the scale when they are excluded, and little when they are not") {
  test::Rng rng("scale outliers");
  std::vector<double> r;
  std::vector<std::uint8_t> excluded;
  for (int i = 0; i < 4000; ++i) {
    const bool moving = i % 10 < 3;
    r.push_back(moving ? rng.uniform(15, 60) : student(rng, 5, 1.0));
    excluded.push_back(moving ? 1 : 0);
  }
  ScaleWorkspace<double> workspace;
  const auto clean = estimate_scale<double>(r, excluded, {}, workspace);
  const auto mixed = estimate_scale<double>(std::span<const double>(r), 5.0);
  CHECK(*clean == doctest::Approx(1.0).epsilon(0.06));
  // 30 % gross outliers: a standard deviation would be above 20, and the bare fixed point breaks down.
  CHECK(*mixed < 1.3);
  ScaleOptions<double> bare;
  bare.gross = 0;
  CHECK(*estimate_scale<double>(r, {}, bare, workspace) > 5.0);
}

TEST_CASE("too few or degenerate residuals are told") {
  const std::vector<double> two{1, 2}, zeros{0, 0, 0, 0, 1}, bad{std::nan(""), 1, 2};
  CHECK_FALSE(estimate_scale<double>(std::span<const double>(two), 5.0));
  CHECK_FALSE(estimate_scale<double>(std::span<const double>(bad), 5.0));
  // Fault: 0 was returned, and 0 / 0 is a weight of NaN.
  CHECK(*estimate_scale<double>(std::span<const double>(zeros), 5.0) == ScaleOptions<double>().floor);
}

TEST_CASE_TEMPLATE("the scale of residuals of any size is theirs", S, float, double) {
  test::Rng rng("scale of any size");
  std::vector<S> unit;
  for (int i = 0; i < 2001; ++i) unit.push_back(static_cast<S>(student(rng, 5, 1.0)));
  for (const double gross : {6.0, 0.0}) {
    ScaleOptions<S> options;
    options.gross = static_cast<S>(gross);
    ScaleWorkspace<S> workspace;
    const S one = *estimate_scale<S>(unit, {}, options, workspace);
    const int most = std::numeric_limits<S>::max_exponent - 12,
              least = std::numeric_limits<S>::min_exponent + 30;
    for (const int exponent : {least, -84, -83, -40, 0, 40, 66, 100, most}) {  // 1e-25: -83, 1e20: 66
      std::vector<S> r;
      for (const S a : unit) r.push_back(std::ldexp(a, exponent));
      CAPTURE(exponent);
      CHECK(*estimate_scale<S>(r, {}, options, workspace) == std::ldexp(one, exponent));
    }
  }
  for (const double size : {1e-25, 1e-19, 1e-6, 1e20, 1e30}) {
    std::vector<S> r;
    for (const S a : unit) r.push_back(static_cast<S>(double(a) * size));
    CHECK(double(*estimate_scale<S>(std::span<const S>(r), S(5))) == doctest::Approx(size).epsilon(0.05));
  }
  // Denormal ones, the largest there are, and outliers beyond all squares.
  const S least = std::numeric_limits<S>::denorm_min(), most = std::numeric_limits<S>::max();
  ScaleWorkspace<S> workspace;
  ScaleOptions<S> bare;
  bare.gross = S(0);
  for (const auto& options : {ScaleOptions<S>(), bare}) {
    const auto scale = [&](const std::vector<S>& r) { return *estimate_scale<S>(r, {}, options, workspace); };
    CHECK(scale({least, -least, least, least}) == options.floor);
    CHECK(scale({most / 2, -most / 2, most / 2, most / 2}) > most / 4);
    CHECK(scale({most / 2, -most / 2, most / 2, most / 2}) < most);
    const S mixed = scale({S(1), S(-1), S(1), S(-1), S(1), S(1), S(-1), S(1), S(-1), S(1), most});
    CHECK(mixed > S(0.5));
    CHECK(mixed < S(3));
  }
}

TEST_CASE_TEMPLATE("the sum of rho is that of logarithms up to the largest numbers", S, float, double) {
  RhoSum<S, TDistribution<S>> sum(TDistribution<S>::with_dimension(S(5), 3));
  double expected = 0;
  for (double s = 1; s < 0.2 * double(std::numeric_limits<S>::max()); s *= 1e3) {
    for (const double next : {1e17, s}) {  // a product that is large already
      sum.add(static_cast<S>(next));
      expected += 8 * std::log1p(next / 5);
    }
  }
  CHECK(double(sum.value()) == doctest::Approx(expected).epsilon(1e-5));
}

TEST_CASE_TEMPLATE("the joint covariance of residuals of any size, some of them no numbers, is theirs", S,
                   float, double) {
  using Vector = Eigen::Matrix<S, 3, 1>;
  test::Rng rng("covariance of any size");
  std::vector<Eigen::Vector3d> unit;
  for (int i = 0; i < 4000; ++i)
    unit.emplace_back(4 * student(rng, 5, 1), student(rng, 5, 1), 0.03 * student(rng, 5, 1));
  for (const double size : {1e-15, 1e-13, 1.0, 1e12, 1e15}) {
    for (const double start : {1e-12, 1.0, 1e12}) {
      std::vector<Vector> r;
      for (const auto& u : unit) r.push_back((size * u).cast<S>());
      r[7](1) = std::numeric_limits<S>::quiet_NaN();
      r[8](2) = std::numeric_limits<S>::infinity();
      CAPTURE(size);
      CAPTURE(start);
      const Eigen::Matrix<S, 3, 3> initial = Eigen::Matrix<S, 3, 3>::Identity() * static_cast<S>(start);
      const auto estimate = estimate_covariance<S, 3>(r, initial, S(5));
      const auto expected = estimate_covariance<double, 3>(std::span<const Eigen::Vector3d>(unit),
                                                           Eigen::Matrix3d::Identity(), 5.0);
      REQUIRE(estimate);
      REQUIRE(expected);
      const Eigen::Matrix3d back = estimate->template cast<double>() / (size * size);
      for (int i = 0; i < 3; ++i) {
        CHECK(back(i, i) == doctest::Approx((*expected)(i, i)).epsilon(0.01));
        for (int j = 0; j < i; ++j)
          CHECK(std::abs(back(i, j) - (*expected)(i, j)) <
                0.01 * std::sqrt((*expected)(i, i) * (*expected)(j, j)));
      }
    }
  }
}

TEST_CASE("the joint covariance is recovered from a wrong start") {
  test::Rng rng("joint covariance");
  const Eigen::Vector3d sigma(4.0, 0.8, 0.03);
  std::vector<Eigen::Vector3d> r;
  for (int i = 0; i < 20000; ++i) {
    double chi2 = 0;
    for (int k = 0; k < 5; ++k) chi2 += std::pow(rng.normal(), 2);
    r.push_back(Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal()).cwiseProduct(sigma) /
                std::sqrt(chi2 / 5));
  }
  const auto estimate = estimate_covariance<double, 3>(r, Eigen::Matrix3d::Identity(), 5.0);
  REQUIRE(estimate);
  for (int i = 0; i < 3; ++i) CHECK(std::sqrt((*estimate)(i, i)) == doctest::Approx(sigma(i)).epsilon(0.04));
}

TEST_CASE("the printed form has nu 11 and numerator 12, in whatever numbers it is asked for") {
  // Fault: TDistribution(11, 12) took 12 for a dimension and had the numerator 23.
  CHECK(TDistribution<double>::paper().numerator == 12.0);
  CHECK(TDistribution<double>::with_numerator(11, 12).numerator == 12.0);
  CHECK(TDistribution<double>::with_dimension(11, 12).numerator == 23.0);
  CHECK(TDistribution<double>::with_dimension(5, 1).numerator == 6.0);
  // Fault: TDistribution(5) had the numerator nu + 1, where the documentation says nu + d.
  static_assert(!std::is_constructible_v<TDistribution<double>, int>);
  static_assert(!std::is_default_constructible_v<TDistribution<double>> &&
                !std::is_aggregate_v<TDistribution<double>>);
  static_assert(!std::is_constructible_v<TDistribution<double>, int, int>);
  static_assert(!std::is_constructible_v<TDistribution<float>, float, float>);
}

TEST_CASE_TEMPLATE("a scale never falls below its floor, however many residuals are zero", S, float, double) {
  ScaleWorkspace<S> workspace;
  ScaleOptions<S> options;
  options.floor = S(0.5);
  const auto scale = [&](const std::vector<S>& r) {
    return *estimate_scale<S>(std::span<const S>(r), {}, options, workspace);
  };
  CHECK(scale({S(0), S(0), S(0), S(1)}) == S(0.5));
  CHECK(scale({S(0), S(0), S(0.1), S(0.1)}) == S(0.5));
  CHECK(scale({S(0), S(0), S(1), S(2)}) == doctest::Approx(0.934).epsilon(1e-2));  // half of them: a scale
  CHECK(scale({S(3), S(-4), S(5), S(-6)}) > S(3));
}
