// SPDX-License-Identifier: BSD-3-Clause
#include <sstream>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/nets/onnx_segmenter.hpp"
#include "targets.hpp"

namespace dynslam::fuzz {
namespace {

using namespace runtime;

void list(Bytes bytes) {
  std::istringstream in(text_of(bytes));
  try {
    (void)parse_list(in, "list");
  } catch (const InputError&) {
  }
}

void associations(Bytes bytes) {
  std::istringstream in(text_of(bytes));
  try {
    (void)parse_associations(in, "associations");
  } catch (const InputError&) {
  }
}

/// Also what evaluation makes of it.
void trajectory(Bytes bytes) {
  std::istringstream in(text_of(bytes));
  try {
    const auto poses = parse_trajectory(in, "trajectory");
    (void)absolute_trajectory_error<double>(poses, poses);
  } catch (const InputError&) {
  }
}

void camera(Bytes bytes) {
  std::istringstream in(text_of(bytes));
  try {
    const CameraConfig config = parse_camera(in, "camera");
    if (const auto p = config.model.unproject({0, 0}, 1.0)) (void)config.model.project(*p);
  } catch (const InputError&) {
  }
}

void class_names(Bytes bytes) {
  (void)parse_class_names(text_of(bytes));
}

}  // namespace

void add_text_targets(std::vector<Target>& targets) {
  targets.push_back({"list", list, [] {
                       return std::vector<std::string>{
                           "# colour\n1305031102.175304 rgb/1305031102.175304.png\n1305031102.2 rgb/2.png\n"};
                     }});
  targets.push_back({"associations", associations, [] {
                       return std::vector<std::string>{
                           "1.5 rgb/1.png 1.51 depth/1.png\n2 rgb/2.png 2 depth/2.png\n"};
                     }});
  targets.push_back({"trajectory", trajectory, [] {
                       return std::vector<std::string>{
                           "# t x y z qx qy qz qw\n1 0 0 0 0 0 0 1\n2 1e-1 -2 3 .5 .5 .5 .5\n"
                           "3 1 1 1 0 0 1 0\n4 2 1 5 1 0 0 0\n"};
                     }});
  targets.push_back(
      {"camera", camera, [] {
         return std::vector<std::string>{
             "name = room\nwidth = 640\nheight = 480\nfx = 517.3\nfy = 516.5\ncx = 318.6\ncy = 255.3\n"
             "k1 = 0.26\nk2 = -0.95\np1 = -0.005\np2 = 0.003\nk3 = 1.16\ndepth_units_per_metre = 5000\n"};
       }});
  targets.push_back({"class_names", class_names, [] {
                       return std::vector<std::string>{"{0: 'person', 1: 'bicycle', 2: \"traffic light\"}"};
                     }});
}

std::vector<Target> targets() {
  std::vector<Target> all;
  add_text_targets(all);
  add_map_targets(all);
  add_network_targets(all);
  return all;
}

}  // namespace dynslam::fuzz
