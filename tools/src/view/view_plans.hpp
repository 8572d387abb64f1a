// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

#include "dynslam/runtime/view/view_painter.hpp"
#include "view/ground_plan.hpp"

namespace dynslam::runtime::viewing {

/// What a view shows from above.
class ViewPlans {
 public:
  explicit ViewPlans(const PainterOptions& options, const ViewLayout& layout)
      : options_(options), layout_(layout) {}
  void draw(cv::Mat& canvas, const ViewScene& scene);

 private:
  void draw_trajectory(cv::Mat& canvas, const ViewScene& scene);
  void draw_map(cv::Mat& canvas, const ViewScene& scene);
  void paint_voxels(const ViewScene& scene);
  [[nodiscard]] PlanBox box_of_voxels(const ViewScene& scene) const;

  PainterOptions options_;
  ViewLayout layout_;
  PlanAxes axes_;
  GroundPlan near_{0.3}, far_{1.5};
  cv::Mat voxels_;                 // as they were drawn last
  std::size_t drawn_version_ = 0;  // of them
  PlanBox box_;                    // of them
  std::vector<std::uint8_t> labels_;
};

}  // namespace dynslam::runtime::viewing
