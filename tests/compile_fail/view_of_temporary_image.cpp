// SPDX-License-Identifier: BSD-3-Clause
// A view of an image that is gone. EXPECT: view
#include "dynslam/image/image.hpp"

dynslam::Image<float> depth();

float first_pixel() {
#ifdef RIGHT
  const dynslam::Image<float> image = depth();
  const auto pixels = image.view();
#else
  const auto pixels = depth().view();
#endif
  return pixels(0, 0);
}
