// SPDX-License-Identifier: BSD-3-Clause
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "io/base64.hpp"
#include "io/run_lengths.hpp"
#include "report/evidence.hpp"
#include "report/run_folder.hpp"
#include "targets.hpp"

namespace dynslam::fuzz {
namespace {

void evidence(Bytes bytes) {
  std::istringstream in(text_of(bytes));
  try {
    const auto read = runtime::parse_evidence(in, "report.jsonl");
    for (const auto& [stamp, frame] : read.frames) (void)read.masks(stamp);
  } catch (const runtime::InputError&) {
  }
}

void timings(Bytes bytes) {
  std::istringstream in(text_of(bytes));
  try {
    (void)runtime::parse_times(in, "timings.csv");
  } catch (const runtime::InputError&) {
  }
}

std::vector<std::string> evidence_seeds() {
  const cv::Mat mask = (cv::Mat_<std::uint8_t>(2, 3) << 0, 0, 5, 5, 5, 0);
  const std::string runs = runtime::to_base64(runtime::encode_runs(mask));
  return {R"({"report":1,"sequence":"/s","width":3,"height":2})"
          "\n"
          R"({"frame":"1.000000","state":"tracked","keyframe":true,"matches":9,"inliers":7,"masks":")" +
          runs +
          R"(","keypoints":"EAAIAP8="})"
          "\n"
          R"({"keyframes":[[0,1.0,0,0,0],[2,1.5,0.1,0,0]],"edges":[[0,2,31]],"loops":[[2,0,80]]})"
          "\n"};
}

}  // namespace

void add_report_targets(std::vector<Target>& targets) {
  targets.push_back({"evidence", evidence, evidence_seeds});
  targets.push_back({"timings", timings, [] {
                       return std::vector<std::string>{
                           "timestamp,features,tracking,mask_age_s,points\n1.000000,1.5,20.25,,300\n"};
                     }});
}

}  // namespace dynslam::fuzz
