// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/semantic_mapper.hpp"

#include <doctest/doctest.h>

#include <fstream>
#include <memory>

#include "dynslam/interop/octomap.hpp"
#include "dynslam/runtime/error.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

const DistortedPinhole<double> kCamera(Pinhole<double>(100, 100, 80, 60));

/// A wall at 2 m; a block in its middle at 1 m.
MapKeyframe keyframe(bool block, Label block_label, bool masked) {
  MapKeyframe k;
  k.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(2.0));
  k.bgr = cv::Mat(120, 160, CV_8UC3, cv::Scalar(10, 100, 200));
  k.labels = cv::Mat::zeros(120, 160, CV_8UC1);
  k.dynamic_mask = cv::Mat::zeros(120, 160, CV_8UC1);
  if (block) {
    const cv::Rect area(60, 40, 40, 40);
    k.depth(area) = 1.0;
    k.labels(area) = static_cast<std::uint8_t>(block_label);
    if (masked) k.dynamic_mask(area) = 255;
  }
  return k;
}

Occupancy at(const SemanticMapper& mapper, float x, float y, float z) { return interop::occupancy(mapper.tree(), {x, y, z}); }

}  // namespace

TEST_CASE("surfaces become occupied, rays free, the rest stays unknown; colours are kept") {
  SemanticMapper mapper(kCamera, 160, 120, {});
  mapper.insert(keyframe(false, Label::background, false));
  mapper.finish();
  CHECK(at(mapper, 0.02F, 0.02F, 2.01F) == Occupancy::occupied);
  CHECK(at(mapper, 0.02F, 0.02F, 1.02F) == Occupancy::free);
  CHECK(at(mapper, 0.02F, 0.02F, 2.52F) == Occupancy::unknown);
  const auto* node = mapper.tree().search(0.02, 0.02, 2.01);
  REQUIRE(node != nullptr);
  CHECK(node->getColor() == octomap::ColorOcTreeNode::Color(200, 100, 10));
}

TEST_CASE("people and masked pixels never enter the map; chairs and displays carry their label") {
  for (const bool masked : {false, true}) {
    SemanticMapper mapper(kCamera, 160, 120, {});
    mapper.insert(keyframe(true, masked ? Label::background : Label::person, masked));
    mapper.finish();
    CHECK(at(mapper, 0.02F, 0.02F, 1.01F) != Occupancy::occupied);
    CHECK(at(mapper, 1.0F, 0.02F, 2.01F) == Occupancy::occupied);
  }
  for (const Label label : {Label::chair, Label::display}) {
    SemanticMapper mapper(kCamera, 160, 120, {});
    mapper.insert(keyframe(true, label, false));
    mapper.finish();
    CHECK(label_of_colour(mapper.tree().search(0.02, 0.02, 1.01)->getColor()) == label);
    CHECK(label_of_colour(mapper.tree().search(1.0, 0.02, 2.01)->getColor()) == Label::background);
  }
}

TEST_CASE("what has left is cleared by the rays that pass where it was") {
  SemanticMapper mapper(kCamera, 160, 120, {});
  mapper.insert(keyframe(true, Label::background, false));
  for (int i = 0; i < 4; ++i) mapper.insert(keyframe(false, Label::background, false));
  mapper.finish();
  CHECK(at(mapper, 0.02F, 0.02F, 1.01F) == Occupancy::free);
}

TEST_CASE("a saved map reads back with labels; two runs give the same bytes; bad paths are told") {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.ot", "b.ot"}) {
    SemanticMapper mapper(kCamera, 160, 120, {});
    for (int i = 0; i < 3; ++i) mapper.insert(keyframe(true, Label::chair, false));
    mapper.finish();
    mapper.save(folder.path / name);
    CHECK_THROWS_AS(mapper.save(folder.path / "no" / "such.ot"), InputError);
  }
  const auto bytes = [&](const char* name) {
    std::ifstream in(folder.path / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  CHECK(bytes("a.ot") == bytes("b.ot"));
  const std::unique_ptr<octomap::AbstractOcTree> tree(octomap::AbstractOcTree::read((folder.path / "a.ot").string()));
  const auto* colour = dynamic_cast<const octomap::ColorOcTree*>(tree.get());
  REQUIRE(colour != nullptr);
  CHECK(label_of_colour(colour->search(0.02, 0.02, 1.01)->getColor()) == Label::chair);
}
