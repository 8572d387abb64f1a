// SPDX-License-Identifier: BSD-3-Clause
// The lenses against OpenCV's projectPoints, undistortPoints and fisheye functions.
#include <doctest/doctest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

const cv::Mat kNone = cv::Mat::zeros(3, 1, CV_64F);

cv::Mat matrix(const Pinhole<double>& c) {
  return (cv::Mat_<double>(3, 3) << c.fx(), 0, c.cx(), 0, c.fy(), c.cy(), 0, 0, 1);
}

struct Lens {
  const char* name;
  Pinhole<double> pinhole;
  BrownConrady<double> distortion;
};

const Lens kLenses[] = {
    {"fr1", {517.306, 516.469, 318.643, 255.314}, {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}},
    {"fr2", {520.909, 521.007, 325.141, 249.702}, {0.231222, -0.784899, -0.003257, -0.000105, 0.917205}},
    {"EuRoC", {458.654, 457.296, 367.215, 248.375}, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}},
    {"wide", {300, 300, 320, 240}, {-0.5, 0, 0.001, -0.001, 0}},
    // Eight coefficients: an Azure Kinect's, whose two polynomials nearly cancel, and one with a pole.
    {"rational",
     {915.5, 915.3, 957.7, 551.5},
     {0.4536, -2.5436, 0.000831, -0.000261, 1.4513, 0.3331, -2.3635, 1.3783}},
    {"pole", {300, 300, 320, 240}, {-0.6, 0.05, 0.001, -0.001, 0, -0.9, 0.1, 0.02}}};

/// The same camera with numbers of 24 bits: 1e-7 of a thousand pixels, a few times.
template <class Camera>
void check_float(const Camera& camera, const Eigen::Vector3d& p, const cv::Point2d& expected) {
  const auto x = camera.template cast<float>().project(p.cast<float>());
  REQUIRE(x);
  CHECK(std::hypot(x->x() - static_cast<float>(expected.x), x->y() - static_cast<float>(expected.y)) < 2e-3F);
}

}  // namespace

TEST_CASE("Brown and Conrady's lens agrees with OpenCV's within its field") {
  test::Rng rng("opencv lens");
  for (const Lens& lens : kLenses) {
    CAPTURE(lens.name);
    const PinholeBrownConrady<double> camera(lens.pinhole, lens.distortion);
    const cv::Mat K = matrix(lens.pinhole);
    cv::Mat k(8, 1, CV_64F);
    for (int i = 0; i < 8; ++i) k.at<double>(i) = lens.distortion.coefficients()(i);
    const double reach = std::min(0.6, 0.9 * lens.distortion.valid_radius());
    for (int n = 0; n < 300; ++n) {
      const double r = reach * std::sqrt(rng.uniform()), a = rng.uniform(-3.2, 3.2), z = rng.uniform(0.3, 6);
      const Eigen::Vector3d p(r * std::cos(a) * z, r * std::sin(a) * z, z);
      std::vector<cv::Point2d> expected;
      cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, kNone, kNone, K, k, expected);
      const auto x = camera.project(p);
      REQUIRE(x);
      CHECK(std::hypot(x->x() - expected[0].x, x->y() - expected[0].y) < 1e-9);
      check_float(camera, p, expected[0]);
      std::vector<cv::Point2d> straight;
      cv::undistortPoints(expected, straight, K, k, cv::noArray(), K,
                          cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-13));
      const auto ideal = camera.undistort_pixel(*x);
      REQUIRE(ideal);
      CHECK(std::hypot(ideal->x() - straight[0].x, ideal->y() - straight[0].y) < 1e-5);
    }
  }
}

TEST_CASE("Kannala and Brandt's lens agrees with OpenCV's fisheye functions") {
  test::Rng rng("opencv fisheye");
  const Eigen::Vector4d coefficients[] = {
      {0.0034824, 0.00071503, -0.0020532, 0.00020294}, {-0.05, 0.01, -0.004, 0.0005}, {0, 0, 0, 0}};
  for (const Eigen::Vector4d& c : coefficients) {
    const KannalaBrandt<double> camera(190.978, 190.973, 254.932, 256.897, c);
    const cv::Mat K = matrix(Pinhole<double>(camera.fx(), camera.fy(), camera.cx(), camera.cy()));
    const cv::Mat k = (cv::Mat_<double>(4, 1) << c(0), c(1), c(2), c(3));
    for (int n = 0; n < 300; ++n) {
      const double theta = rng.uniform(0, 1.45), a = rng.uniform(-3.2, 3.2), z = rng.uniform(0.3, 6);
      const Eigen::Vector3d p(std::tan(theta) * std::cos(a) * z, std::tan(theta) * std::sin(a) * z, z);
      std::vector<cv::Point2d> expected;
      cv::fisheye::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, expected, kNone, kNone, K,
                                 k);
      const auto x = camera.project(p);
      REQUIRE(x);
      CHECK(std::hypot(x->x() - expected[0].x, x->y() - expected[0].y) < 1e-9);
      check_float(camera, p, expected[0]);
      std::vector<cv::Point2d> straight;
      cv::fisheye::undistortPoints(expected, straight, K, k);
      const auto ray = camera.unproject(*x, 1.0);
      REQUIRE(ray);
      CHECK(std::hypot(ray->x() - straight[0].x, ray->y() - straight[0].y) < 1e-5 * (1 + std::tan(theta)));
    }
  }
}
