// SPDX-License-Identifier: BSD-3-Clause
#include <optional>
#include <sstream>
#include <stdexcept>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/config/options_file.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/frame_pipe.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/nets/onnx_segmenter.hpp"
#include "io/formats/format.hpp"
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

/// What formats write beside their images: poses and cameras.
template <class Parse>
void parse_text(Bytes bytes, Parse&& parse) {
  std::istringstream in(text_of(bytes));
  try {
    parse(in);
  } catch (const InputError&) {
  }
}

void pose_matrix(Bytes bytes) {
  parse_text(bytes, [](std::istream& in) {
    if (const auto matrix = formats::parse_matrix(in, "pose")) (void)formats::rigid_motion(*matrix);
  });
}

void pose_rows(Bytes bytes) {
  parse_text(bytes, [](std::istream& in) { (void)formats::parse_pose_rows(in, "traj", 30); });
}

void pose_log(Bytes bytes) {
  parse_text(bytes, [](std::istream& in) { (void)formats::parse_log(in, "log", std::vector<double>(100)); });
}

void eth3d_camera(Bytes bytes) {
  parse_text(bytes, [](std::istream& in) {
    (void)formats::parse_eth3d_camera(in, {640, 480}, "calibration");
  });
}

void json_cameras(Bytes bytes) {
  parse_text(bytes, [&](std::istream&) { (void)formats::parse_replica_camera(text_of(bytes), "replica"); });
  parse_text(bytes, [&](std::istream&) { (void)formats::parse_open3d_camera(text_of(bytes), "open3d"); });
}

void frame_pipe(Bytes bytes) {
  parse_text(bytes, [](std::istream& in) {
    FramePipe pipe(in, "pipe");
    while (pipe.next()) {
    }
  });
}

void class_names(Bytes bytes) {
  (void)parse_class_names(text_of(bytes));
}

/// What was read is printed, and is read again as the same.
void config(Bytes bytes) {
  const auto read = [](const std::string& text) {
    RunOptions options;
    std::optional<DynamicsMode> dynamics;
    ConfigFields fields = config_fields(options, dynamics);
    std::istringstream in(text);
    (void)read_config(in, "config", fields);
    return config_file(fields);
  };
  std::string printed;
  try {
    printed = read(text_of(bytes));
  } catch (const InputError&) {
    return;
  }
  if (read(printed) != printed) throw std::logic_error("a configuration reads back as another one");
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
             "k1 = 0.26\nk2 = -0.95\np1 = -0.005\np2 = 0.003\nk3 = 1.16\ndepth_units_per_metre = 5000\n",
             "width = 640\nheight = 480\nfx = 300\nfy = 300\ncx = 320\ncy = 240\nmodel = kannala_brandt\n"
             "k1 = -0.02\nk4 = 0.001\ndepth_noise = stereo\nbaseline = 0.05\ndisparity_noise = 0.1\n",
             "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
             "  data: [500., 0., 320., 0.,\n    505., 240., 0., 0., 1.]\n"
             "distortion_model: rational_polynomial\ndistortion_coefficients:\n"
             "  data: [.4, -2.5, 1e-3, 0, 1.4, .3, -2.3, 1.3]\nroi:\n  x_offset: 0\ninvalid_depth: 9\n",
             "%YAML:1.0\n---\nheight: 480\nwidth: 640\nfisheye_model: 1\nd: # four\n- 0.1\n- 0.\n"
             "K: !!opencv-matrix\n  dt: d\n  data: [ 5.0e+02, 0., 320., 0., 505., 240., 0., 0., 1. ]\n",
             "<?xml version=\"1.0\"?>\n<opencv_storage>\n<!-- c -->\n<image_width>640</image_width>\n"
             "<image_height>480</image_height>\n<camera_matrix type_id=\"opencv-matrix\"><rows>3</rows>\n"
             "<data>500. 0. 320. 0. 505. 240. 0. 0. 1.</data></camera_matrix>\n<v><_>\"a\"</_></v>\n"
             "</opencv_storage>\n"};
       }});
  targets.push_back({"pose_matrix", pose_matrix, [] {
                       return std::vector<std::string>{
                           "1 0 0 1e-1\n0 1 0 -2\n0 0 1 3\n0 0 0 1\n",
                           "-inf -inf -inf -inf\n-inf 1 0 0\n0 0 nan 0\n0 0 0 1\n"};
                     }});
  targets.push_back({"pose_rows", pose_rows, [] {
                       return std::vector<std::string>{
                           "0 -1 0 1 1 0 0 2 0 0 1 3 0 0 0 1\n"
                           "1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\n"};
                     }});
  targets.push_back({"pose_log", pose_log, [] {
                       return std::vector<std::string>{
                           "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
                           "3 3 4\n1 0 0 0\n0 1 0 0\n0 0 1 1\n0 0 0 1\n"};
                     }});
  targets.push_back({"eth3d_camera", eth3d_camera,
                     [] { return std::vector<std::string>{"726.28 726.28 354.65 186.47\n"}; }});
  targets.push_back(
      {"json_cameras", json_cameras, [] {
         return std::vector<std::string>{
             R"({"camera": {"w": 1200, "h": 680, "fx": 600.0, "fy": 600.0, "cx": 599.5, "cy": 339.5,
                 "scale": 6553.5}})",
             R"({"width": 640, "height": 480, "intrinsic_matrix": [525, 0, 0, 0, 525, 0, 319.5, 239.5, 1]})"};
       }});
  targets.push_back(
      {"frame_pipe", frame_pipe, [] {  // two frames: BGR and 16 bits, grey and floats
         const std::string head =
             "dynslam-frames 1\nwidth=64 height=64 fx=60 fy=60 cx=32 cy=32 depth_units_per_metre=1000\n";
         const std::string first("FRME\1\0\0\0\0\0\0\0\0\0\0\0\0\x30\0\0\0\x20\0\0", 24),
             second("FRME\2\0\0\0\0\0\0\0\2\1\0\0\0\x10\0\0\0\x40\0\0", 24);
         const std::string images(64 * 64 * 5, 'x');
         return std::vector<std::string>{head + first + images + second + images};
       }});
  targets.push_back({"class_names", class_names, [] {
                       return std::vector<std::string>{"{0: 'person', 1: 'bicycle', 2: \"traffic light\"}"};
                     }});
}

void add_config_target(std::vector<Target>& targets) {
  targets.push_back(
      {"config", config, [] {
         return std::vector<std::string>{
             "[general]\nmap = true # c\nseed = 1_0\ncamera = 'fr3'\n[tracker.geometry.weights]\nnumerator = "
             "\"auto\"\n"
             "tau = 1e-1\n[segmentation.segmenter]\nmap_classes = [\"a\\u0041\", 'b',]\ninput = [640, 480]\n"
             "[tracker]\nadditions = \"all\"\nmethod = \"paper\"\npose.nu = 4\n"};
       }});
}

std::vector<Target> targets() {
  std::vector<Target> all;
  add_text_targets(all);
  add_config_target(all);
  add_bag_targets(all);
  add_map_targets(all);
  add_network_targets(all);
  add_report_targets(all);
  return all;
}

}  // namespace dynslam::fuzz
