// SPDX-License-Identifier: BSD-3-Clause
#include <doctest/doctest.h>

#include <Eigen/Core>
#include <type_traits>
#include <utility>

#include "dynslam/image/eigen_view.hpp"
#include "dynslam/image/image_row.hpp"
#include "dynslam/image/strided_view.hpp"
#include "image_kinds.hpp"
#include "image_operations.hpp"

using namespace dynslam;

namespace {

using RowMajor = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <class M>
concept HasView = requires {
  view(std::declval<M>());
};
static_assert(HasView<Eigen::MatrixXf&> && HasView<const RowMajor&>);
static_assert(!HasView<Eigen::MatrixXf> && !HasView<RowMajor>);  // a temporary takes its memory along
static_assert(HasView<Eigen::Map<Eigen::MatrixXf>> && HasView<Eigen::Block<Eigen::MatrixXf>>);
static_assert(!HasView<decltype(std::declval<RowMajor&>() + std::declval<RowMajor&>())>);  // has no memory
static_assert(std::is_same_v<decltype(view(std::declval<RowMajor&>())), ImageView<float>>);
static_assert(std::is_same_v<decltype(view(std::declval<const RowMajor&>())), ImageView<const float>>);
static_assert(std::is_same_v<decltype(view(std::declval<Eigen::MatrixXd&>())), StridedView<double>>);
static_assert(
    std::is_same_v<decltype(view(std::declval<const Eigen::MatrixXd&>())), StridedView<const double>>);

}  // namespace

TEST_CASE("an Eigen matrix of either storage order is viewed by column and row, without a copy") {
  const auto check = [](auto matrix) {
    for (Eigen::Index v = 0; v < 3; ++v) {
      for (Eigen::Index u = 0; u < 5; ++u) matrix(v, u) = static_cast<float>(10 * v + u);
    }
    auto image = view(matrix);
    CHECK(image.width() == 5);
    CHECK(image.height() == 3);
    CHECK(image(4, 1) == 14.0F);
    image(2, 2) = -1.0F;
    CHECK(matrix(2, 2) == -1.0F);
    const auto& read_only = matrix;
    CHECK(view(read_only)(3, 0) == 3.0F);
    auto part = view(matrix.block(1, 2, 2, 3));  // a part keeps the strides of the whole
    CHECK(part.width() == 3);
    CHECK(part(2, 0) == 14.0F);
    part(1, 1) = 7.0F;
    CHECK(matrix(2, 3) == 7.0F);
  };
  check(Eigen::MatrixXf(3, 5));
  check(RowMajor(3, 5));
  check(Eigen::Matrix<float, 3, 5>());
  check(Eigen::Array<float, 3, 5, Eigen::RowMajor>());
  std::vector<float> memory(40, 0.0F);  // every second column of every second row
  Eigen::Map<RowMajor, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>> sparse(
      memory.data(), 2, 4, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(20, 2));
  memory[26] = 3.0F;
  CHECK(view(sparse)(3, 1) == 3.0F);
  CHECK(view(Eigen::MatrixXf(Eigen::MatrixXf::Zero(0, 4)).block(0, 0, 0, 4)).height() == 0);
}

TEST_CASE("a strided view addresses any regular pixels") {
  std::vector<int> memory(24);
  for (int i = 0; i < 24; ++i) memory[static_cast<std::size_t>(i)] = i;
  const StridedView<int> green(memory.data() + 1, 4, 2, 3, 12);  // one channel of three
  CHECK(green(0, 0) == 1);
  CHECK(green(3, 1) == 22);
  const StridedView<const int> mirrored(memory.data() + 3, 4, 6, -1, 4);
  CHECK(mirrored(0, 0) == 3);
  CHECK(mirrored(3, 5) == 20);
  const StridedView<const int> read_only = green;
  CHECK(read_only(1, 1) == 16);
  CHECK_FALSE(green.contains(4, 0));
}

TEST_CASE_TEMPLATE("every operation gives the same on each kind of image", Kind, test::ViewKind,
                   test::PlainKind, test::RowMajorKind, test::ColumnMajorKind) {
  static const auto expected = test::run_image_operations<test::OwnedKind>();
  CHECK(test::run_image_operations<Kind>() == expected);
}
