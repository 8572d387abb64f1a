// SPDX-License-Identifier: BSD-3-Clause
// Templates of the core say which abs() they call: without std::abs the C library's may be taken, whose numbers are int
// (on x86-64 others' headers hide it). To compile is to pass.
namespace dynslam {

struct NoNumber {};
void abs(NoNumber);  // is found before the C library's

}  // namespace dynslam

#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/rolling_camera.hpp"

template class dynslam::AnyCamera<float>;
template class dynslam::AnyCamera<double>;
template class dynslam::RollingCamera<dynslam::AnyCamera<float>>;
template class dynslam::RollingCamera<dynslam::AnyCamera<double>>;
