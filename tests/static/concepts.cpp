// SPDX-License-Identifier: BSD-3-Clause
// What must satisfy a concept and what must not. To compile is to pass.
#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include <Eigen/Core>
#include <unsupported/Eigen/AutoDiff>

#include "dynslam/dynslam.hpp"

#ifdef DYNSLAM_HAVE_OPENCV
#include <opencv2/core.hpp>
#endif

namespace {

using dynslam::CameraModel;
using dynslam::DepthImage;
using dynslam::DifferentiableCamera;
using dynslam::FixedMatrix;
using dynslam::Image;
using dynslam::ImageLike;
using dynslam::ImageView;
using dynslam::LabelImage;
using dynslam::MutableImage;
using dynslam::RobustKernel;
using dynslam::Scalar;

// Scalar: real numbers and dual numbers, never integers, whose division would truncate.
static_assert(Scalar<float>);
static_assert(Scalar<double>);
static_assert(Scalar<Eigen::AutoDiffScalar<Eigen::Vector3d>>);
static_assert(!Scalar<int>);
static_assert(!Scalar<bool>);
static_assert(!Scalar<std::complex<double>>);
static_assert(!Scalar<std::string>);

// FixedMatrix: plain matrices, blocks and expressions of the right shape.
static_assert(FixedMatrix<Eigen::Vector3d, 3>);
static_assert(FixedMatrix<Eigen::Matrix2f, 2, 2>);
static_assert(FixedMatrix<decltype(std::declval<const Eigen::Vector4d&>().head<3>()), 3>);
static_assert(FixedMatrix<decltype(2.0 * std::declval<const Eigen::Vector3d&>()), 3>);
static_assert(!FixedMatrix<Eigen::Vector4d, 3>);
static_assert(!FixedMatrix<Eigen::RowVector3d, 3>);
static_assert(!FixedMatrix<Eigen::VectorXd, 3>);
static_assert(!FixedMatrix<double, 3>);

// Images: (u, v) access through Pixel, width(), height().
static_assert(ImageLike<Image<float>>);
static_assert(ImageLike<ImageView<const std::uint8_t>>);
static_assert(DepthImage<ImageView<const float>>);
static_assert(DepthImage<Image<double>>);
static_assert(!DepthImage<Image<std::uint16_t>>);  // raw depth is not yet in metres
static_assert(LabelImage<Image<std::uint8_t>>);
static_assert(!LabelImage<Image<float>>);
static_assert(MutableImage<ImageView<float>>);
static_assert(!MutableImage<ImageView<const float>>);
static_assert(std::is_convertible_v<ImageView<float>, ImageView<const float>>);
static_assert(!std::is_convertible_v<ImageView<const float>, ImageView<float>>);
// Any regular steps, e.g. Eigen's of either storage order by view().
static_assert(MutableImage<dynslam::StridedView<float>> && !dynslam::RowImage<dynslam::StridedView<float>>);
static_assert(
    std::same_as<decltype(dynslam::view(std::declval<Eigen::MatrixXf&>())), dynslam::StridedView<float>>);
// Rows are pointers to pixels: what only turns into one, or points to what has another size, is read by (u,
// v).
template <class Row>
struct ImageOfRows {
  using Pixel = float;
  [[nodiscard]] int width() const { return 0; }
  [[nodiscard]] int height() const { return 0; }
  [[nodiscard]] float operator()(int, int) const { return 0; }
  [[nodiscard]] Row row(int) const;
};
struct RowHandle {
  operator const float*() const;
};
static_assert(dynslam::RowImage<ImageOfRows<const float*>> && dynslam::RowImage<ImageOfRows<float*>>);
static_assert(dynslam::ImageLike<ImageOfRows<RowHandle>> && !dynslam::RowImage<ImageOfRows<RowHandle>>);
static_assert(!dynslam::RowImage<ImageOfRows<std::nullptr_t>> &&
              !dynslam::RowImage<ImageOfRows<const double*>>);
template <class I>
concept HasPyramid = requires(dynslam::HalvingPyramid<std::uint8_t>& pyramid, const I& image) {
  pyramid.build(image, 1);
};
static_assert(HasPyramid<ImageOfRows<const float*>> && HasPyramid<ImageOfRows<RowHandle>>);
static_assert(!HasPyramid<Image<std::array<std::uint8_t, 3>>>);  // colours have no mean of four
// What functions write: an image by reference, a view by value; no constant, no temporary.
static_assert(dynslam::OutputLabelImage<Image<std::uint8_t>&> && dynslam::OutputLabelImage<ImageView<int>>);
static_assert(!dynslam::OutputImage<const Image<float>&> && !dynslam::OutputImage<ImageView<const float>>);
// Indexed by row first: these would be read transposed.
static_assert(!ImageLike<Eigen::MatrixXf>);
static_assert(!ImageLike<Eigen::ArrayXXd>);
#ifdef DYNSLAM_HAVE_OPENCV
static_assert(!ImageLike<cv::Mat>);
static_assert(!ImageLike<cv::Mat1f>);
#endif

// Cameras.
static_assert(CameraModel<dynslam::Pinhole<float>>);
static_assert(CameraModel<dynslam::Pinhole<double>>);
static_assert(CameraModel<dynslam::PinholeBrownConrady<double>>);
static_assert(DifferentiableCamera<dynslam::Pinhole<float>>);
static_assert(DifferentiableCamera<dynslam::PinholeBrownConrady<float>>);
static_assert(DifferentiableCamera<dynslam::PinholeBrownConrady<Eigen::AutoDiffScalar<Eigen::Vector3d>>>);
static_assert(DifferentiableCamera<dynslam::KannalaBrandt<float>>);
static_assert(DifferentiableCamera<dynslam::KannalaBrandt<Eigen::AutoDiffScalar<Eigen::Vector3d>>>);
static_assert(DifferentiableCamera<dynslam::AnyCamera<double>>);
static_assert(DifferentiableCamera<dynslam::AnyCamera<Eigen::AutoDiffScalar<Eigen::Vector3d>>>);
static_assert(!CameraModel<Eigen::Matrix3d>);
static_assert(!CameraModel<dynslam::SE3<double>>);

// Growing asks by depths or by pixels.
static_assert(dynslam::GrowingCriterion<dynslam::RelativeStep<float>, float>);
static_assert(dynslam::SiteCriterion<dynslam::SameLabelStep<Image<int>, dynslam::FixedStep<double>>, double>);
static_assert(!dynslam::GrowingCriterion<dynslam::FixedStep<float>, Image<float>> &&
              !dynslam::GrowingCriterion<int, float>);

// What refers to an argument takes no temporary one, which would be gone; what keeps it does.
using Step = dynslam::FixedStep<float>;
using Labels = dynslam::SameLabelStep<Image<int>, Step>;
using Normals = dynslam::SmoothSurfaceStep<Image<Eigen::Vector3f>, Step>;
using Features = dynslam::FeatureView;
template <class T>
using Span = std::span<const T>;
static_assert(std::is_constructible_v<Labels, const Image<int>&, Step>);
static_assert(!std::is_constructible_v<Labels, Image<int>, Step>);
static_assert(std::is_constructible_v<Normals, const Image<Eigen::Vector3f>&, float, Step>);
static_assert(!std::is_constructible_v<Normals, Image<Eigen::Vector3f>, float, Step>);
static_assert(std::is_constructible_v<Features, Span<dynslam::Feature>, Span<dynslam::Descriptor>,
                                      Span<std::uint8_t>, const dynslam::FeatureGrid&>);
static_assert(!std::is_constructible_v<Features, Span<dynslam::Feature>, Span<dynslam::Descriptor>,
                                       Span<std::uint8_t>, dynslam::FeatureGrid>);
template <class T>
concept GivesView = requires(T&& owner) {
  std::forward<T>(owner).view();
};
static_assert(GivesView<Image<int>&> && GivesView<const Image<int>&> && !GivesView<Image<int>>);
static_assert(GivesView<const dynslam::FeatureFrame<>&> && !GivesView<dynslam::FeatureFrame<>>);
static_assert(
    std::is_copy_assignable_v<dynslam::RollingCamera<dynslam::Pinhole<double>>>);  // keeps its camera

// Voxels: what queries ask, and what takes scans too, of any number of labels.
static_assert(dynslam::VoxelStore<dynslam::VoxelBlockMap<float>> &&
              dynslam::VoxelStore<dynslam::VoxelBlockMap<double, 80>>);
static_assert(!dynslam::VoxelMap<dynslam::VoxelGrid> && !dynslam::VoxelMap<int>);

// Robust kernels: rho and weight of the squared normalised residual.
static_assert(RobustKernel<dynslam::Huber<double>, double>);
static_assert(RobustKernel<dynslam::Cauchy<float>, float>);
static_assert(RobustKernel<dynslam::TDistribution<double>, double>);
static_assert(!RobustKernel<double, double>);

}  // namespace
