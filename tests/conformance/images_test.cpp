// SPDX-License-Identifier: BSD-3-Clause
#include "images.hpp"

#include <type_traits>

using namespace dynslam;

TEST_CASE_TEMPLATE("functions of images give the same on each kind of image", Kind, test::OwnedKind,
                   test::ViewKind, test::PlainKind, test::RowMajorKind, test::ColumnMajorKind) {
  static const auto expected = test::image_results<test::OwnedKind, double>();
  test::check_same(test::image_results<Kind, double>(), expected, 0);
  test::check_same(test::image_results<Kind, float>(), expected, 1e-3);
}

namespace {

/// A pyramid of another project, of images that are rows and nothing more.
struct OwnRows {
  using Pixel = float;
  const Image<float>* image = nullptr;
  [[nodiscard]] int width() const { return image->width(); }
  [[nodiscard]] int height() const { return image->height(); }
  [[nodiscard]] float operator()(int u, int v) const { return (*image)(u, v); }
  [[nodiscard]] const float* row(int v) const { return image->row(v); }
};
struct OwnPyramid {
  std::vector<Image<float>> levels;
  [[nodiscard]] int size() const { return static_cast<int>(levels.size()); }
  [[nodiscard]] OwnRows image(int level) const { return {&levels[static_cast<std::size_t>(level)]}; }
  [[nodiscard]] Eigen::Vector2d scale(int level) const {
    return Eigen::Vector2d::Constant(static_cast<double>(1 << level));
  }
};
static_assert(ImagePyramidLike<OwnPyramid> && RowImage<OwnRows>);

}  // namespace

#include "dynslam/features/patch_matcher.hpp"
#include "dynslam/features/patch_search.hpp"
#include "dynslam/optim/patch_alignment.hpp"

TEST_CASE_TEMPLATE("patches are cut, searched and matched in anybody's pyramid", S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  Image<float> gray(test::kWidth, test::kHeight, 0.0F);
  for (int v = 0; v < gray.height(); ++v) {
    for (int u = 0; u < gray.width(); ++u)
      gray(u, v) =
          static_cast<float>(128 + 60 * std::sin(0.31 * u + 0.2 * v) + 60 * std::cos(0.27 * v - 0.11 * u));
  }
  HalvingPyramid<float> pyramid;
  pyramid.build(gray, 2);
  OwnPyramid own;
  for (int level = 0; level < pyramid.size(); ++level) {
    own.levels.emplace_back(pyramid.image(level).width(), pyramid.image(level).height());
    for (int v = 0; v < pyramid.image(level).height(); ++v) {
      for (int u = 0; u < pyramid.image(level).width(); ++u)
        own.levels.back()(u, v) = pyramid.image(level)(u, v);
    }
  }
  const Vector2 x(S(80), S(60)), start(S(81), S(59.5));
  const Eigen::Matrix<S, 2, 2> same = Eigen::Matrix<S, 2, 2>::Identity();
  const auto find = [&](const auto& p) {
    const PointPatch patch = cut_patch<S>(p, x, 0);
    CHECK(patch.level == 0);
    const auto matched = match_patch<S>(p, patch, same, start);
    const auto searched = search_patch<S>(p, x, same, p, start);
    REQUIRE(matched.has_value());
    REQUIRE(searched.has_value());
    CHECK((matched->x - x).norm() < S(0.1));
    CHECK((*searched - x).norm() < S(0.5));
    return std::pair(matched->x, *searched);
  };
  CHECK(find(pyramid) == find(own));
  AlignmentPatch<S, 8> reference;
  std::array<S, 100> bordered{};
  for (int v = 0; v < 10; ++v) {
    for (int u = 0; u < 10; ++u) bordered[static_cast<std::size_t>(10 * v + u)] = S(gray(75 + u, 55 + v));
  }
  REQUIRE(reference.set(bordered, S(8)));
  const auto aligned = reference.align(own.image(0), start);
  CHECK(aligned.ok());
  CHECK((aligned.x - x).norm() < S(0.1));
}
