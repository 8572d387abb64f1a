// SPDX-License-Identifier: BSD-3-Clause
#include "report/evidence.hpp"

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/base64.hpp"
#include "io/run_lengths.hpp"

namespace dynslam::runtime {
namespace {

using nlohmann::json;

constexpr int kLongest = 8192;                            // side of an image [px]
constexpr std::uint64_t kLimit = std::uint64_t(4) << 30;  // of the file [bytes]: a million frames
constexpr std::size_t kBytesOfKeypoint = 5;

int whole_number(const json& number) {
  const std::int64_t value = number.is_number_integer() ? number.get<std::int64_t>() : -1;
  if (value < 0 || value > std::numeric_limits<int>::max())
    throw std::invalid_argument("a number is none from 0");
  return static_cast<int>(value);
}

std::vector<std::uint8_t> bytes_of(const json& text) {
  auto bytes = from_base64(text.get_ref<const std::string&>());
  if (!bytes) throw std::invalid_argument("what should be base64 is not");
  return std::move(*bytes);
}

std::vector<EvidenceKeypoint> keypoints_of(const json& text) {
  const auto bytes = bytes_of(text);
  if (bytes.size() % kBytesOfKeypoint != 0) throw std::invalid_argument("keypoints end in the middle of one");
  std::vector<EvidenceKeypoint> keypoints;
  for (std::size_t i = 0; i < bytes.size(); i += kBytesOfKeypoint) {
    const auto pixels = [&](std::size_t at) {
      return static_cast<float>(bytes[at] | bytes[at + 1] << 8U) / 8.0F;
    };
    keypoints.push_back({pixels(i), pixels(i + 2), bytes[i + 4]});
  }
  return keypoints;
}

FrameEvidence frame_of(const json& j, cv::Size size) {
  FrameEvidence frame;
  frame.state = j.at("state").get<std::string>();
  frame.keyframe = j.at("keyframe").get<bool>();
  frame.matches = whole_number(j.at("matches"));
  frame.inliers = whole_number(j.at("inliers"));
  frame.masks = bytes_of(j.at("masks"));
  if (!decode_runs(frame.masks, size)) throw std::invalid_argument("masks do not fill the image");
  frame.judged = j.contains("keypoints");
  if (frame.judged) frame.keypoints = keypoints_of(j["keypoints"]);
  return frame;
}

std::vector<GraphEdge> edges_of(const json& list, const std::map<int, int>& known) {
  std::vector<GraphEdge> edges;
  for (const json& j : list) {
    const GraphEdge edge{whole_number(j.at(0)), whole_number(j.at(1)), whole_number(j.at(2))};
    if (!known.contains(edge.a) || !known.contains(edge.b))
      throw std::invalid_argument("an edge names a keyframe that is not there");
    edges.push_back(edge);
  }
  return edges;
}

void take_graph(const json& j, Evidence& evidence) {
  std::map<int, int> known;
  for (const json& k : j.at("keyframes")) {
    GraphNode node{whole_number(k.at(0)), k.at(1).get<double>(), {}};
    for (std::size_t i = 0; i < 3; ++i) node.p_w[i] = k.at(2 + i).get<double>();
    known[node.id] = 1;
    evidence.keyframes.push_back(node);
  }
  evidence.edges = edges_of(j.at("edges"), known);
  evidence.loops = edges_of(j.at("loops"), known);
}

void take_head(const json& j, Evidence& evidence) {
  if (whole_number(j.at("report")) != 1)
    throw std::invalid_argument("is of a version that this program does not know");
  evidence.sequence = j.at("sequence").get<std::string>();
  evidence.size = {whole_number(j.at("width")), whole_number(j.at("height"))};
  if (evidence.size.width < 1 || evidence.size.height < 1 || evidence.size.width > kLongest ||
      evidence.size.height > kLongest)
    throw std::invalid_argument("has an impossible size of images");
}

}  // namespace

cv::Mat pixels_with(const cv::Mat& values, std::uint8_t bit) {
  cv::Mat some;
  cv::bitwise_and(values, cv::Scalar(bit), some);
  return some != 0;
}

cv::Mat Evidence::masks(const std::string& stamp) const {
  const auto frame = frames.find(stamp);
  if (frame == frames.end()) return {};
  return decode_runs(frame->second.masks, size).value_or(cv::Mat());
}

Evidence read_evidence(const std::filesystem::path& file) {
  std::istringstream in(read_text(file, kLimit));
  return parse_evidence(in, file.string());
}

Evidence parse_evidence(std::istream& in, const std::string& name) {
  LineReader lines(in);
  Evidence evidence;
  bool begun = false, ended = false;
  const auto fail = [&](const std::string& reason) -> InputError { return {name, lines.number(), reason}; };
  while (lines.next()) {
    if (ended) throw fail("goes on behind its end");
    try {
      const json j = json::parse(lines.line());
      if (!begun) {
        take_head(j, evidence);
        begun = true;
      } else if (j.contains("frame")) {
        evidence.frames[j["frame"].get<std::string>()] = frame_of(j, evidence.size);
      } else {
        take_graph(j, evidence);
        ended = true;
      }
    } catch (const json::parse_error&) {
      throw fail("is damaged: no JSON");
    } catch (const json::exception& error) {
      throw fail(std::string("is damaged: ") + error.what());
    } catch (const std::invalid_argument& error) {
      throw fail(std::string("is damaged: ") + error.what());
    }
  }
  if (!ended) throw InputError(name, 0, "ends early: the run was not finished");
  return evidence;
}

}  // namespace dynslam::runtime
