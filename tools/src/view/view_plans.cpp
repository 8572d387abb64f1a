// SPDX-License-Identifier: BSD-3-Clause
#include "view/view_plans.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "view/view_canvas.hpp"

namespace dynslam::runtime::viewing {
namespace {

constexpr int kCaption = 24;  // height of a panel's caption [px]

cv::Rect plan_area(const cv::Rect& panel) {
  return {panel.x + 1, panel.y + kCaption, panel.width - 2, panel.height - kCaption - 1};
}

cv::Rect caption_of(const cv::Rect& panel) {
  return {panel.x, panel.y, panel.width, kCaption};
}

/// A panel's caption, and to the right of it what colours mean where there is room.
void draw_frame(cv::Mat& canvas, const cv::Rect& panel, const std::string& caption,
                const std::vector<std::pair<std::string, cv::Scalar>>& legend) {
  cv::rectangle(canvas, panel, kLine, 1);
  const cv::Rect line = caption_of(panel);
  const int end = write(canvas, caption, line, panel.x + 8, kSmall, kInk);
  int left = panel.br().x - 8;
  for (auto it = legend.rbegin(); it != legend.rend(); ++it) {
    left -= legend_width(it->first);
    if (left < end + 12) return;
    write_legend(canvas, it->first, line, left, it->second);
    left -= 12;
  }
}

const cv::Scalar& colour_of_camera(const ViewScene& scene) {
  const TrackingState s = scene.frame.state;
  return s == TrackingState::tracked || s == TrackingState::relocalised ? kRun : kSoft;
}

/// Values between which all but a hundredth lies.
std::pair<double, double> most_of(std::vector<double>& values) {
  const std::size_t few = values.size() / 200;
  const auto low = values.begin() + static_cast<std::ptrdiff_t>(few);
  std::nth_element(values.begin(), low, values.end());
  const double least = *low;
  const auto high = values.begin() + static_cast<std::ptrdiff_t>(values.size() - 1 - few);
  std::nth_element(values.begin(), high, values.end());
  return {least, *high};
}

}  // namespace

void ViewPlans::draw(cv::Mat& canvas, const ViewScene& scene) {
  if (axes_.follow(scene.trajectory)) {
    near_.forget();
    far_.forget();
    voxels_.release();
  }
  draw_trajectory(canvas, scene);
  if (options_.map) draw_map(canvas, scene);
}

void ViewPlans::draw_trajectory(cv::Mat& canvas, const ViewScene& scene) {
  const cv::Rect area = plan_area(layout_.trajectory);
  cv::Mat plan = canvas(area);
  plan.setTo(kPlan);
  PlanBox box;
  for (const auto* path : {&scene.trajectory, &scene.truth}) {
    for (const auto& pose : *path) box.add(axes_.flat(pose.T_w_c.translation()));
  }
  near_.show(box, area.size());
  if (!box.empty()) {
    near_.draw_grid(plan);
    near_.draw_path(plan, axes_, scene.truth, kTruth, 5);  // to be seen where the camera is right
    near_.draw_path(plan, axes_, scene.trajectory, kRun, 2);
  }
  if (!scene.trajectory.empty()) {
    near_.draw_camera(plan, axes_, scene.trajectory.back().T_w_c, colour_of_camera(scene));
    near_.draw_bar(plan);
  }
  std::vector<std::pair<std::string, cv::Scalar>> legend{{"camera", kRun}};
  if (options_.truth) legend.emplace_back("ground truth", kTruth);
  draw_frame(canvas, layout_.trajectory, "trajectory from above", legend);
}

PlanBox ViewPlans::box_of_voxels(const ViewScene& scene) const {
  PlanBox box;
  if (scene.voxels.empty()) return box;
  const std::size_t step = 1 + scene.voxels.size() / 20000;
  std::vector<double> x, y;
  for (std::size_t i = 0; i < scene.voxels.size(); i += step) {
    const Eigen::Vector2d p = axes_.flat(scene.voxels[i].centre.cast<double>());
    x.push_back(p.x());
    y.push_back(p.y());
  }
  const auto [x0, x1] = most_of(x);
  const auto [y0, y1] = most_of(y);
  box.add({x0, y0});
  box.add({x1, y1});
  return box;
}

/// The higher one of two voxels covers the lower one, and what has a class everything: that is looked for.
void ViewPlans::paint_voxels(const ViewScene& scene) {
  voxels_.setTo(kPlan);
  far_.draw_grid(voxels_);
  struct Cell {
    double height;
    const ViewVoxel* voxel;
  };
  std::vector<Cell> cells;
  std::vector<double> heights;
  labels_.clear();
  for (const ViewVoxel& v : scene.voxels) {
    cells.push_back({axes_.up.dot(v.centre.cast<double>()), &v});
    heights.push_back(cells.back().height);
    if (v.label != 0 && std::find(labels_.begin(), labels_.end(), v.label) == labels_.end())
      labels_.push_back(v.label);
  }
  if (cells.empty()) return;
  std::sort(labels_.begin(), labels_.end());
  const auto [low, high] = most_of(heights);
  std::sort(cells.begin(), cells.end(), [](const Cell& a, const Cell& b) {
    const bool a_named = a.voxel->label != 0, b_named = b.voxel->label != 0;
    return a_named != b_named ? b_named : a.height < b.height;
  });
  for (const Cell& cell : cells) {
    const Rgb& c = cell.voxel->colour;
    // What is low is darker.
    const double light = std::clamp((cell.height - low) / std::max(high - low, 1e-6), 0.0, 1.0);
    const double shade = cell.voxel->label != 0 ? 1 : 0.5 + 0.5 * light;
    const cv::Point2d at = far_.pixel(axes_.flat(cell.voxel->centre.cast<double>()));
    const double half = std::max(0.5, double(cell.voxel->edge) * far_.scale() / 2);
    if (std::abs(at.x) > 1e5 || std::abs(at.y) > 1e5) continue;  // a stray one
    const cv::Point first(cvFloor(at.x - half + 0.5), cvFloor(at.y - half + 0.5));
    const cv::Point last(cvFloor(at.x + half + 0.5), cvFloor(at.y + half + 0.5));
    const cv::Rect square = cv::Rect(first, last) & cv::Rect({0, 0}, voxels_.size());
    if (!square.empty()) voxels_(square).setTo(cv::Scalar(c[2], c[1], c[0]) * shade);
  }
}

void ViewPlans::draw_map(cv::Mat& canvas, const ViewScene& scene) {
  const cv::Rect area = plan_area(layout_.map);
  const bool other = voxels_.empty() || drawn_version_ != scene.map_version;
  if (other) box_ = box_of_voxels(scene);
  PlanBox box = box_;
  for (const auto& pose : scene.trajectory) box.add(axes_.flat(pose.T_w_c.translation()));
  const bool moved = far_.show(box, area.size());
  if (other || moved) {
    voxels_.create(area.size(), CV_8UC3);
    paint_voxels(scene);
    drawn_version_ = scene.map_version;
  }
  cv::Mat plan = canvas(area);
  voxels_.copyTo(plan);
  if (!scene.trajectory.empty()) {
    far_.draw_path(plan, axes_, scene.trajectory, cv::Scalar::all(0), 3);
    far_.draw_path(plan, axes_, scene.trajectory, kRun, 1);
    far_.draw_camera(plan, axes_, scene.trajectory.back().T_w_c, colour_of_camera(scene));
    far_.draw_bar(plan);
  }
  std::vector<std::pair<std::string, cv::Scalar>> legend;
  for (const std::uint8_t label : labels_) {
    const Rgb c = class_colour(label);
    legend.emplace_back(scene.classes.name(label), cv::Scalar(c[2], c[1], c[0]));
  }
  draw_frame(canvas, layout_.map, "map from above", legend);
}

}  // namespace dynslam::runtime::viewing
