// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/map_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/masks.hpp"
#include "io/map_sum.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using interop::SemanticOcTree;
using Node = interop::SemanticOcTreeNode;

constexpr const char* kType = "SemanticOcTree";
constexpr const char* kLabelStart = "# label ";  // N NAME: a comment to OctoMap
constexpr const char *kTextStart = "# Octomap OcTree file", *kBinaryStart = "# Octomap OcTree binary file";

/// Header of OctoMap's files. @param kind  "file" (.ot) or "binary file" (.bt)
void write_header(std::ostream& out, const SemanticOcTree& tree, const char* kind, const char* type,
                  const MapClasses& classes = {}) {
  out << "# Octomap OcTree " << kind
      << "\n# (feel free to add / change comments, but leave the first line as it is!)\n#\n";
  for (std::uint8_t label = 0; label < kMapLabels; ++label)
    if (classes.own(label)) out << kLabelStart << int(label) << ' ' << classes.name(label) << '\n';
  out << "id " << type << "\nsize " << tree.size() << "\nres " << fmt::format("{}", tree.getResolution())
      << "\ndata\n";
}

void write_colour_node(std::ostream& out, const SemanticOcTree& tree, const Node* node) {
  const float value = node->getLogOdds();
  out.write(reinterpret_cast<const char*>(&value), sizeof value);
  for (const std::uint8_t c : voxel_colour(*node)) out.put(static_cast<char>(c));
  unsigned children = 0;
  for (unsigned i = 0; i < 8; ++i) children |= tree.nodeChildExists(node, i) ? 1U << i : 0U;
  out.put(static_cast<char>(children));
  for (unsigned i = 0; i < 8; ++i) {
    if ((children >> i & 1U) != 0) write_colour_node(out, tree, tree.getNodeChild(node, i));
  }
}

void write_ply(std::ostream& out, const SemanticOcTree& tree, const MapClasses& classes) {
  std::string vertices;
  std::size_t count = 0;
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const Rgb c = voxel_colour(*it);
    vertices += fmt::format("{} {} {} {} {} {} {} {:.3f} {}\n", static_cast<float>(it.getX()),
                            static_cast<float>(it.getY()), static_cast<float>(it.getZ()), c[0], c[1], c[2],
                            it->label(), it->labels().confidence(), static_cast<float>(it.getSize()));
    ++count;
  }
  out << "ply\nformat ascii 1.0\ncomment occupied cells of a semantic octree, metres\n";
  for (std::uint8_t label = 0; label < kMapLabels; ++label)
    if (classes.own(label)) out << "comment label " << int(label) << ' ' << classes.name(label) << '\n';
  out << "element vertex " << count
      << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
         "property uchar blue\nproperty uchar label\nproperty float confidence\nproperty float "
         "edge\nend_header\n"
      << vertices;
}

void write_map(std::ostream& out, const SemanticOcTree& tree, const MapClasses& classes) {
  write_summed(out, [&](std::ostream& summed) {
    write_header(summed, tree, "file", kType, classes);
    tree.writeData(summed);
  });
}

struct Header {
  std::string first, type;
  double resolution = 0;
  std::size_t size = 0;
  bool ends = false;
  MapClasses classes{};
};

/// "N NAME"; what is no label of the user's own is a comment like any other.
void read_label(const std::string& text, MapClasses& classes) {
  std::istringstream words(text);
  unsigned label = 0;
  std::string name;
  if (words >> label && label < kMapLabels && std::getline(words >> std::ws, name))
    (void)classes.set(static_cast<std::uint8_t>(label), name);
}

/// Line by line, with a bound: a foreign file may have no line end at all. What follows the first line is
/// read where that is OctoMap's.
Header read_header(std::istream& in) {
  const auto line = [&] {
    std::string text;
    for (int c = in.get(); c != '\n' && c != std::istream::traits_type::eof() && text.size() < 256;
         c = in.get())
      text += static_cast<char>(c);
    return text;
  };
  Header header;
  header.first = line();
  if (!header.first.starts_with(kTextStart)) return header;
  for (int n = 0; n <= 100; ++n) {
    const std::string text = line();
    if (!in) break;
    if (text == "data") {
      header.ends = true;
      break;
    }
    std::istringstream words(text);
    std::string word;
    words >> word;
    if (text.starts_with(kLabelStart)) read_label(text.substr(std::strlen(kLabelStart)), header.classes);
    if (word == "id") words >> header.type;
    if (word == "res") words >> header.resolution;
    if (word == "size") words >> header.size;
  }
  return header;
}

}  // namespace

Rgb class_colour(std::uint8_t label) {
  switch (static_cast<Label>(label)) {
    case Label::background:
      return {128, 128, 128};
    case Label::person:
      return {220, 20, 60};
    case Label::chair:
      return {192, 0, 0};
    case Label::display:
      return {0, 64, 128};
  }
  constexpr std::array<Rgb, 4> kOthers{{{0, 128, 0}, {128, 0, 128}, {128, 128, 0}, {0, 128, 128}}};
  return kOthers[label % kOthers.size()];
}

std::string class_name(std::uint8_t label) {
  return MapClasses().name(label);
}

Rgb voxel_colour(const Node& node) {
  if (node.label() != static_cast<std::uint8_t>(Label::background)) return class_colour(node.label());
  Rgb colour = node.colour();
  for (std::uint8_t label = 1; label < kMapLabels; ++label) {
    if (colour == class_colour(label)) colour[2] ^= 1;  // never a class's colour by chance
  }
  return colour;
}

void save_map(const SemanticOcTree& tree, const fs::path& path, const MapClasses& classes) {
  // OctoMap's own file functions print to the terminal when a path cannot be written; its stream functions do
  // not.
  AtomicFile file(path);
  write_map(file.stream(), tree, classes);
  file.commit();
}

fs::path map_file_in(const fs::path& folder) {
  const bool earlier = !fs::exists(folder / kMapFile) && fs::exists(folder / kEarlierMapFile);
  return folder / (earlier ? kEarlierMapFile : kMapFile);
}

bool is_semantic_map(const fs::path& path) {
  std::error_code error;
  std::ifstream in;
  if (fs::is_regular_file(path, error)) in.open(path, std::ios::binary);
  return in.is_open() && read_header(in).type == kType;
}

std::unique_ptr<SemanticOcTree> load_map(const fs::path& path, std::string* note) {
  const auto fail = [&](const std::string& reason) -> InputError { return {path.string(), 0, reason}; };
  if (!fs::exists(path)) {
    const bool renamed = path.filename() == kEarlierMapFile && fs::exists(map_file_in(path.parent_path()));
    throw fail(renamed ? fmt::format("does not exist; {} beside it does", kMapFile) : "does not exist");
  }
  if (fs::is_directory(path)) throw fail("is a folder, not a map");
  check_regular_file(path);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw fail("cannot be opened");
  const std::size_t sum = check_sum_of(in, path);
  const auto [first, type, resolution, size, ends, classes] = read_header(in);
  if (first.starts_with(kBinaryStart))
    throw fail(fmt::format("is a .bt file, which has no labels; give the {}", kMapFile));
  if (!first.starts_with(kTextStart)) throw fail("is not an OctoMap file");
  if (!ends) throw fail("has an OctoMap header that does not end");
  if (type != kType)
    throw fail(fmt::format("is a map of type '{}', which has no labels; expected {}", type, kType));
  if (!(resolution >= 1e-6 && resolution <= 1e6)) throw fail("has no valid resolution");
  auto tree = std::make_unique<SemanticOcTree>(resolution);
  if (size > 0) {
    tree->readData(in);
    if (in.bad()) throw fail("cannot be read");
    if (!in) throw fail("is cut short or corrupt");
  }
  if (tree->size() != size) throw fail(fmt::format("is corrupt: {} nodes instead of {}", tree->size(), size));
  in.ignore(static_cast<std::streamsize>(sum));
  if (in.get() != std::ifstream::traits_type::eof()) throw fail("is corrupt: data after its end");
  if (sum == 0 && note != nullptr)
    *note = path.string() + ": has no check sum (dynslam 0.1.0 wrote none), so that damage may go unnoticed";
  return tree;
}

MapClasses load_map_classes(const fs::path& path) {
  std::error_code error;
  std::ifstream in;
  if (fs::is_regular_file(path, error)) in.open(path, std::ios::binary);
  if (!in.is_open()) return {};
  (void)check_sum_of(in, path);
  return read_header(in).classes;
}

bool has_occupied(const SemanticOcTree& tree) {
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (tree.isNodeOccupied(*it)) return true;
  }
  return false;
}

void export_map(const SemanticOcTree& tree, const fs::path& path, const MapClasses& classes) {
  const std::string extension = path.extension().string();
  const auto writer = [&]() -> std::function<void(std::ostream&)> {
    if (extension == ".sot") return [&](std::ostream& out) { write_map(out, tree, classes); };
    if (extension == ".ot") {
      return [&](std::ostream& out) {
        write_header(out, tree, "file", "ColorOcTree");
        if (tree.getRoot() != nullptr) write_colour_node(out, tree, tree.getRoot());
      };
    }
    if (extension == ".bt") {
      return [&](std::ostream& out) {
        write_header(out, tree, "binary file", "OcTree");
        if (tree.getRoot() != nullptr) tree.writeBinaryData(out);
      };
    }
    if (extension == ".ply") return [&](std::ostream& out) { write_ply(out, tree, classes); };
    if (extension == ".txt") return [&](std::ostream& out) { out << to_text(summarize(tree, classes)); };
    if (extension == ".json")
      return [&](std::ostream& out) { out << to_json(summarize(tree, classes)).dump(2) << '\n'; };
    throw UsageError(
        fmt::format("'{}': the extension is none of .sot .ot .bt .ply .txt .json", path.string()));
  }();
  AtomicFile file(path);
  writer(file.stream());
  file.commit();
}

MapSummary summarize(const SemanticOcTree& tree, const MapClasses& classes) {
  MapSummary s;
  s.classes = classes;
  s.resolution = tree.getResolution();
  s.nodes = tree.size();
  s.bytes = tree.memoryUsage();
  s.low.fill(std::numeric_limits<double>::max());
  s.high.fill(std::numeric_limits<double>::lowest());
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    const std::size_t voxels = std::size_t(1) << (3 * (tree.getTreeDepth() - it.getDepth()));
    if (!tree.isNodeOccupied(*it)) {
      s.free += voxels;
      continue;
    }
    s.occupied += voxels;
    s.occupied_of_label[it->label()] += voxels;
    s.confidence_of_label[it->label()] += static_cast<double>(voxels) * it->labels().confidence();
    const std::array<double, 3> centre{it.getX(), it.getY(), it.getZ()};
    for (std::size_t a = 0; a < 3; ++a) {
      s.low[a] = std::min(s.low[a], centre[a] - it.getSize() / 2);
      s.high[a] = std::max(s.high[a], centre[a] + it.getSize() / 2);
    }
  }
  if (s.occupied == 0) s.low = s.high = {};
  for (std::size_t l = 0; l < kMapLabels; ++l) {
    if (s.occupied_of_label[l] > 0) s.confidence_of_label[l] /= static_cast<double>(s.occupied_of_label[l]);
  }
  return s;
}

std::string to_text(const MapSummary& s) {
  std::string text = fmt::format("voxel edge   {} m\nnodes        {} ({:.1f} MB)\n", s.resolution, s.nodes,
                                 static_cast<double>(s.bytes) / 1e6);
  text += fmt::format("occupied     {:>9} voxels {:>10.4f} m^3\nfree         {:>9} voxels {:>10.4f} m^3\n",
                      s.occupied, s.volume(s.occupied), s.free, s.volume(s.free));
  text += fmt::format("box          {:.2f} {:.2f} {:.2f} to {:.2f} {:.2f} {:.2f} m\n", s.low[0], s.low[1],
                      s.low[2], s.high[0], s.high[1], s.high[2]);
  for (std::size_t l = 0; l < kMapLabels; ++l) {
    if (s.occupied_of_label[l] == 0) continue;
    text += fmt::format("{:<12} {:>9} voxels {:>10.4f} m^3  confidence {:.2f}\n",
                        s.classes.name(static_cast<std::uint8_t>(l)), s.occupied_of_label[l],
                        s.volume(s.occupied_of_label[l]), s.confidence_of_label[l]);
  }
  return text;
}

nlohmann::json to_json(const MapSummary& s) {
  nlohmann::json j{{"resolution_m", s.resolution}, {"nodes", s.nodes}, {"bytes", s.bytes}};
  j["occupied"] = {{"voxels", s.occupied}, {"volume_m3", s.volume(s.occupied)}};
  j["free"] = {{"voxels", s.free}, {"volume_m3", s.volume(s.free)}};
  j["box_m"] = {{"low", s.low}, {"high", s.high}};
  j["classes"] = nlohmann::json::object();
  for (std::size_t l = 0; l < kMapLabels; ++l) {
    if (s.occupied_of_label[l] == 0) continue;
    j["classes"][s.classes.name(static_cast<std::uint8_t>(l))] = {
        {"label", l},
        {"voxels", s.occupied_of_label[l]},
        {"volume_m3", s.volume(s.occupied_of_label[l])},
        {"confidence", s.confidence_of_label[l]}};
  }
  return j;
}

}  // namespace dynslam::runtime
