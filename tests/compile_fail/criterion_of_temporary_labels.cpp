// SPDX-License-Identifier: BSD-3-Clause
// The criterion refers to the labels, which would be gone. EXPECT: SameLabelStep
#include "dynslam/image/image.hpp"
#include "dynslam/segment/growing_criteria.hpp"

using Labels = dynslam::Image<int>;
using Step = dynslam::FixedStep<float>;
Labels labels();

dynslam::SameLabelStep<Labels, Step> criterion(const Labels& kept) {
#ifdef RIGHT
  return {kept, Step()};
#else
  static_cast<void>(kept);
  return {labels(), Step()};
#endif
}
