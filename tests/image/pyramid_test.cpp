// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/image/pyramid.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>

#include "dynslam/image/depth_bounds.hpp"
#include "moving_scene.hpp"

using namespace dynslam;

namespace {

/// Rows by something that turns into a pointer.
struct ImageByHandles {
  using Pixel = float;
  struct Handle {
    const float* first;
    operator const float*() const { return first; }
  };
  Image<float> pixels{40, 34};
  [[nodiscard]] int width() const { return pixels.width(); }
  [[nodiscard]] int height() const { return pixels.height(); }
  [[nodiscard]] float operator()(int u, int v) const { return pixels(u, v); }
  [[nodiscard]] Handle row(int v) const { return {pixels.row(v)}; }
};

}  // namespace

TEST_CASE_TEMPLATE("rows that only turn into pointers make the same pyramid", T, std::uint8_t, float) {
  ImageByHandles image;
  for (int v = 0; v < image.height(); ++v)
    for (int u = 0; u < image.width(); ++u) image.pixels(u, v) = static_cast<float>((7 * u + 13 * v) % 251);
  HalvingPyramid<T> by_handles, by_rows;
  by_handles.build(image, 2);
  by_rows.build(image.pixels, 2);
  REQUIRE(by_handles.size() == 2);
  for (int level = 0; level < 2; ++level) {
    for (int v = 0; v < by_rows.image(level).height(); ++v)
      for (int u = 0; u < by_rows.image(level).width(); ++u)
        CHECK(by_handles.image(level)(u, v) == by_rows.image(level)(u, v));
  }
}

TEST_CASE_TEMPLATE("each level is the mean of two by two pixels, and an odd rest is dropped", T, std::uint8_t,
                   float) {
  Image<T> image(67, 41);
  for (int v = 0; v < 41; ++v) {
    for (int u = 0; u < 67; ++u) image(u, v) = static_cast<T>((7 * u + 13 * v) % 200);
  }
  HalvingPyramid<T> pyramid;
  pyramid.build(test::ColumnImage<T>(image), 6);
  REQUIRE(pyramid.size() == 2);  // a third level would be smaller than a patch
  CHECK(pyramid.image(0)(66, 40) == image(66, 40));
  CHECK(pyramid.image(1).width() == 33);
  CHECK(pyramid.image(1).height() == 20);
  for (int v = 0; v < 20; ++v) {
    for (int u = 0; u < 33; ++u) {
      const auto at = [&](int du, int dv) { return static_cast<double>(image(2 * u + du, 2 * v + dv)); };
      const double mean = (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4;
      CHECK(std::abs(static_cast<double>(pyramid.image(1)(u, v)) - mean) <= 0.5);
    }
  }
  pyramid.build(image.view(), 1);
  CHECK(pyramid.size() == 1);
}

TEST_CASE_TEMPLATE("a pixel's centre keeps its place on every level", S, float, double) {
  HalvingPyramid<std::uint8_t> pyramid;
  pyramid.build(Image<std::uint8_t>(128, 96), 3);
  REQUIRE(pyramid.size() == 3);
  const Eigen::Matrix<S, 2, 1> x(S(0.5), S(0.5));  // the corner that four pixels share
  CHECK(to_level<S>(pyramid, x, 1).norm() < S(1e-6));
  for (int level = 0; level < 3; ++level) {
    const Eigen::Matrix<S, 2, 1> p(S(17.25), S(60.5));
    CHECK((to_base<S>(pyramid, to_level<S>(pyramid, p, level), level) - p).norm() < S(1e-4));
  }
}
