// SPDX-License-Identifier: BSD-3-Clause
// Scans that earlier versions saved.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "io/binary_file.hpp"
#include "office.hpp"

using namespace dynslam;
using namespace dynslam::runtime;
namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kSavedMap = 77;

SemanticMapper scans_mapper() {
  return {PinholeBrownConrady<double>(Pinhole<double>(100, 100, 80, 60)), 160, 120, {}};
}
std::string tree_bytes(SemanticMapper& mapper) {
  mapper.finish();
  std::ostringstream out;
  mapper.tree().writeData(out);
  return out.str();
}

/// Two keyframes of a slanted wall, whose depths are multiples of what the file held in version 2, and of
/// 2^-7.
void insert_walls(SemanticMapper& mapper) {
  for (int id = 0; id < 2; ++id) {
    MapKeyframe k;
    k.depth = cv::Mat(120, 160, CV_32FC1);
    for (int u = 0; u < 160; ++u) k.depth.col(u) = 1.0 + 0.125 * (u / 20);
    k.bgr = cv::Mat(120, 160, CV_8UC3, cv::Scalar(10, 100, 200));
    k.T_w_c = SE3<double>(SO3<double>(), Eigen::Vector3d(0.3 * id, 0, 0));
    k.id = id;
    mapper.insert(k);
  }
  mapper.finish();
}

/// The file as version 2 wrote it: depth in fifths of a millimetre.
void write_as_version_2(const fs::path& from, const fs::path& to) {
  BinaryReader in = read_binary(from, "dynslam scans", 3, 1);
  BinaryWriter out;
  out.put(in.get<std::uint64_t>());
  std::vector<std::int32_t> sessions;
  in.get(sessions);
  out.put(sessions);
  const std::size_t n = in.count(16);
  out.put(static_cast<std::uint64_t>(n));
  for (std::size_t k = 0; k < n; ++k) {
    out.put(in.get<std::int32_t>());
    out.put(in.get<SE3<double>>());
    std::vector<std::uint16_t> depth;
    std::vector<std::uint8_t> code, rgb;
    in.get(depth);
    in.get(code);
    in.get(rgb);
    for (std::uint16_t& z : depth)
      z = static_cast<std::uint16_t>(std::lround(5000.0F * DepthCode(z).metres()));
    out.put(depth);
    out.put(code);
    out.put(rgb);
  }
  in.finish();
  write_binary(to, "dynslam scans", 2, out);
}

}  // namespace

TEST_CASE("scans that were saved with depth in fifths of a millimetre make the same map") {
  const test::TemporaryFolder folder;
  const fs::path now = folder.path / "now.bin", then = folder.path / "then.bin",
                 copied = folder.path / "copied.bin";
  SemanticMapper mapper = scans_mapper();
  insert_walls(mapper);
  const std::string expected = tree_bytes(mapper);
  CHECK(mapper.tree().size() > 1000);
  mapper.save_scans(now, kSavedMap);
  write_as_version_2(now, then);
  copy_scans(then, kSavedMap, copied, kSavedMap + 1);
  for (const auto& saved : {std::pair(now, kSavedMap), {then, kSavedMap}, {copied, kSavedMap + 1}}) {
    CAPTURE(saved.first.string());
    SemanticMapper loaded = scans_mapper();
    CHECK(loaded.load_scans(saved.first, {saved.second, 2}).size() == 2);
    CHECK(tree_bytes(loaded) == expected);
  }
  CHECK(test::bytes(copied).size() == test::bytes(now).size());
}
