// SPDX-License-Identifier: BSD-3-Clause
// An Eigen matrix is indexed by row first: as an image it would be read transposed. EXPECT: ImageLike
#include "dynslam/image/sample.hpp"

#ifdef RIGHT
#include "dynslam/image/eigen_view.hpp"
#endif

double grey(const Eigen::MatrixXf& image) {
#ifdef RIGHT
  return *dynslam::bilinear<double>(dynslam::view(image), 1.0, 1.0);
#else
  return *dynslam::bilinear<double>(image, 1.0, 1.0);
#endif
}
