// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <doctest/doctest.h>

#include <cstddef>
#include <opencv2/imgcodecs.hpp>

#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "tum_fixture.hpp"

namespace dynslam::test {

/// A synthetic sequence in a folder of its own, and its frames one by one.
struct RenderedSequence {
  TemporaryFolder folder;
  runtime::Sequence sequence;
  runtime::CameraConfig camera;

  explicit RenderedSequence(const runtime::SynthOptions& scene) {
    runtime::synthesize(scene, folder.path);
    sequence = runtime::load_sequence(folder.path);
    camera = runtime::load_camera(sequence.camera_hint);
  }

  [[nodiscard]] std::size_t size() const { return sequence.frames.size(); }
  [[nodiscard]] runtime::RgbdFrame frame(std::size_t i) const {
    return runtime::decode_frame(sequence.frames[i], i, camera);
  }
  /// What moves in frame i, CV_8UC1.
  [[nodiscard]] cv::Mat dynamic_mask(std::size_t i) const {
    const auto file = folder.path / "dynamic_mask" / (sequence.frames[i].stamp + ".png");
    cv::Mat mask = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
    REQUIRE(!mask.empty());
    return mask;
  }
  /// Error of a pose of frame i, beside where the first frame was [m].
  [[nodiscard]] double error(std::size_t i, const SE3<double>& T_w_c) const {
    const SE3<double> T_first_c =
        sequence.groundtruth.front().T_w_c.inverse() * sequence.groundtruth[i].T_w_c;
    return (T_first_c.inverse() * T_w_c).translation().norm();
  }
};

}  // namespace dynslam::test
