// SPDX-License-Identifier: BSD-3-Clause
// OpenCV's matrices and OctoMap's trees are as good as the library's own images and maps.
#include "dynamics.hpp"
#include "dynslam/interop/octomap.hpp"
#include "dynslam/interop/octomap_semantic_fusion.hpp"
#include "dynslam/interop/octomap_semantic_node.hpp"
#include "dynslam/interop/octomap_semantic_tree.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/semantic/voxel_block_map.hpp"
#include "images.hpp"
#include "voxels.hpp"

using namespace dynslam;

namespace {

/// A cv::Mat_ by view.
struct MatKind {
  template <class T>
  static cv::Mat_<T> make(const Image<T>& from) {
    cv::Mat_<T> m(from.height(), from.width());
    for (int v = 0; v < from.height(); ++v) {
      for (int u = 0; u < from.width(); ++u) m(v, u) = from(u, v);
    }
    return m;
  }
  template <class T>
  static ImageView<const T> in(const cv::Mat_<T>& m) {
    const cv::Mat& mat = m;
    return interop::view<T>(mat);
  }
  template <class T>
  static ImageView<T> out(cv::Mat_<T>& m) {
    return interop::view<T>(m);
  }
};

}  // namespace

TEST_CASE("functions of images give the same on cv::Mat_ by view") {
  const auto expected = test::image_results<test::OwnedKind, double>();
  test::check_same(test::image_results<MatKind, double>(), expected, 0);
  test::check_same(test::image_results<MatKind, float>(), expected, 1e-3);
}

TEST_CASE("what moves is found in cv::Mat_ by view alike") {
  double expected_share = 0, share = 0;
  const auto expected =
      test::segmenter_results<test::OwnedKind, Pinhole<float>>(MotionMethod::full, expected_share);
  test::check_same(test::segmenter_results<MatKind, Pinhole<float>>(MotionMethod::full, share), expected, 0);
  CHECK(share == expected_share);
  test::check_same(test::weight_results<MatKind, Pinhole<float>>(),
                   test::weight_results<test::OwnedKind, Pinhole<float>>(), 0);
}

TEST_CASE("a matrix over the memory of an image has its pixels") {
  Image<float> image(4, 3, 1.0F);
  image(2, 1) = 5.0F;
  CHECK(interop::as_mat(image.view()).at<float>(1, 2) == 5.0F);
}

TEST_CASE_TEMPLATE("OctoMap's trees answer every question as the block map does", Tree,
                   interop::SemanticOcTree, interop::BasicSemanticOcTree<80>) {
  VoxelBlockMap<double> map{VoxelGrid(0.1)};
  const auto expected = test::store_results<double>(map);
  Tree by_doubles(0.1), by_floats(0.1);
  test::check_same(test::store_results<double>(by_doubles), expected, 1e-12);
  test::check_same(test::store_results<float>(by_floats), expected, 1e-5);
  CHECK(interop::occupancy(by_doubles, interop::to_octomap(Eigen::Vector3d(0.03, 0.03, 1.23))) ==
        Occupancy::occupied);
  CHECK(interop::occupancy(by_floats, interop::to_octomap(2 * Eigen::Vector3f(0, 0, 0.3F))) ==
        Occupancy::free);
}

TEST_CASE_TEMPLATE("parameters of either scalar are those of OctoMap's tree", S, float, double) {
  octomap::ColorOcTree tree(0.1);
  LogOddsParams<S> params;
  params.hit = probability_to_log_odds(S(0.8));
  interop::set_parameters(tree, params);
  CHECK(tree.getProbHit() == doctest::Approx(0.8).epsilon(1e-6));
}
