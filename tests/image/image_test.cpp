// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/image/image.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/image/depth.hpp"
#include "dynslam/image/sample.hpp"
#include "dynslam/image/widen.hpp"
#include "random.hpp"

using namespace dynslam;

TEST_CASE("a view addresses (u, v) through its stride") {
  std::vector<int> memory(20);
  for (int i = 0; i < 20; ++i) memory[static_cast<std::size_t>(i)] = i;
  const ImageView<int> view(memory.data() + 1, 3, 4, 5);  // a window of a 5 x 4 image
  CHECK(view(0, 0) == 1);
  CHECK(view(2, 1) == 8);
  CHECK(view.row(3)[1] == 17);
  view(1, 2) = -1;
  CHECK(memory[12] == -1);
  const ImageView<const int> read_only = view;
  CHECK(read_only(1, 2) == -1);
  CHECK(view.contains(2, 3));
  CHECK_FALSE(view.contains(3, 0));
  CHECK_FALSE(view.contains(0, -1));
}

TEST_CASE("an image keeps its memory when it shrinks") {
  Image<float> image(8, 6, 2.5F);
  CHECK(image(7, 5) == 2.5F);
  const float* before = image.data();
  image.resize(4, 3);
  CHECK(image.width() == 4);
  image.resize(8, 6);
  CHECK(image.data() == before);
}

TEST_CASE_TEMPLATE(
    "bilinear interpolation is exact at pixels, borders included, and equals the four-pixel formula", S,
    float, double) {
  test::Rng rng("bilinear");
  Image<S> image(7, 5);
  for (int v = 0; v < 5; ++v) {
    for (int u = 0; u < 7; ++u) image(u, v) = static_cast<S>(rng.uniform(0, 255));
  }
  for (int v = 0; v < 5; ++v) {
    for (int u = 0; u < 7; ++u) {
      const auto value = bilinear<S>(image, S(u), S(v));
      REQUIRE(value);
      CHECK(*value == doctest::Approx(static_cast<double>(image(u, v))));
    }
  }
  for (int k = 0; k < 200; ++k) {
    const S u = static_cast<S>(rng.uniform(0, 5.999)), v = static_cast<S>(rng.uniform(0, 3.999));
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const S a = u - S(i), b = v - S(j);
    const S expected = (1 - a) * (1 - b) * image(i, j) + a * (1 - b) * image(i + 1, j) +
                       (1 - a) * b * image(i, j + 1) + a * b * image(i + 1, j + 1);
    CHECK(*bilinear<S>(image, u, v) == doctest::Approx(static_cast<double>(expected)).epsilon(1e-4));
  }
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK_FALSE(bilinear<S>(image, S(-0.01), S(1)));
  CHECK_FALSE(bilinear<S>(image, S(6.01), S(1)));
  CHECK_FALSE(bilinear<S>(image, S(1), S(4.01)));
  CHECK_FALSE(bilinear<S>(image, nan, S(1)));
}

TEST_CASE("the gradient is the derivative of the interpolant") {
  test::Rng rng("bilinear gradient");
  Image<double> image(6, 6);
  for (int v = 0; v < 6; ++v) {
    for (int u = 0; u < 6; ++u) image(u, v) = rng.uniform(0, 255);
  }
  for (int k = 0; k < 100; ++k) {
    const double u = rng.integer(0, 4) + rng.uniform(0.1, 0.9), v = rng.integer(0, 4) + rng.uniform(0.1, 0.9),
                 h = 1e-5;
    const auto sample = bilinear_with_gradient<double>(image, u, v);
    REQUIRE(sample);
    CHECK(sample->gradient.x() ==
          doctest::Approx((*bilinear<double>(image, u + h, v) - *bilinear<double>(image, u - h, v)) / (2 * h))
              .epsilon(1e-6));
    CHECK(sample->gradient.y() ==
          doctest::Approx((*bilinear<double>(image, u, v + h) - *bilinear<double>(image, u, v - h)) / (2 * h))
              .epsilon(1e-6));
  }
}

TEST_CASE_TEMPLATE("raw depth becomes metres; zero and non-finite values are invalid", S, float, double) {
  std::vector<std::uint16_t> raw{0, 5000, 65535, 1};
  Image<S> metres(2, 2);
  depth_to_metres<S>(ImageView<const std::uint16_t>(raw.data(), 2, 2), S(5000), metres.view());
  CHECK(std::isnan(metres(0, 0)));
  CHECK(metres(1, 0) == doctest::Approx(1.0));
  CHECK(metres(0, 1) == doctest::Approx(13.107));
  CHECK(metres(1, 1) == doctest::Approx(0.0002));
  CHECK(is_valid_depth(metres(1, 1)));
  CHECK_FALSE(is_valid_depth(metres(0, 0)));
  CHECK_FALSE(is_valid_depth(S(0)));
  CHECK_FALSE(is_valid_depth(S(-1)));
  CHECK_FALSE(is_valid_depth(std::numeric_limits<S>::infinity()));
}

TEST_CASE_TEMPLATE("widened pixels are the pixels", S, float, double) {
  std::array<std::uint8_t, 19> bytes{};
  for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] = static_cast<std::uint8_t>(255 - 14 * k);
  for (std::size_t first = 0; first + 8 <= bytes.size(); ++first) {  // at every alignment
    const auto wide = widen<S, 8>(bytes.data() + first);
    for (std::size_t k = 0; k < 8; ++k) CHECK(wide[static_cast<Eigen::Index>(k)] == S(bytes[first + k]));
  }
  const std::array<std::uint16_t, 4> words{0, 1, 4095, 65535};
  const auto wide = widen<S, 4>(words.data());
  for (std::size_t k = 0; k < 4; ++k) CHECK(wide[static_cast<Eigen::Index>(k)] == S(words[k]));
}

TEST_CASE("an image without a fill has zeros, and one of vectors nothing that was set") {
  CHECK(Image<float>(3, 2)(2, 1) == 0.0F);
  CHECK(Image<int>(3, 2, 7)(2, 1) == 7);
  Image<Eigen::Vector3f> vectors(3, 2);
  vectors.fill(Eigen::Vector3f(1, 2, 3));
  CHECK(vectors(2, 1).z() == 3.0F);
  CHECK(Image<Eigen::Vector3f>(3, 2, Eigen::Vector3f::Zero())(0, 0).isZero());
}
