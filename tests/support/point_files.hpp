// SPDX-License-Identifier: BSD-3-Clause
// Readers of PLY and PCD that know nothing of their writers: columns by the names that the header gives them.
#pragma once

#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace dynslam::test {

/// What a file of points, or of a mesh, has.
struct PointFile {
  std::map<std::string, std::vector<double>> columns;  ///< of the points; "rgb" of a PCD as three
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::string> comments;
  [[nodiscard]] std::size_t size() const { return columns.at("x").size(); }
};

namespace detail {
inline double read_number(std::istream& in, const std::string& type) {
  const auto read = [&](auto value) {
    in.read(reinterpret_cast<char*>(&value), sizeof value);
    REQUIRE(in.good());
    return static_cast<double>(value);
  };
  if (type == "float" || type == "F4") return read(float());
  if (type == "uchar" || type == "U1") return read(std::uint8_t());
  if (type == "int") return read(std::int32_t());
  REQUIRE(type == "U4");
  return read(std::uint32_t());
}
}  // namespace detail

/// Reads a binary, little-endian PLY of vertices with numbers and faces with one list. Fails the test where
/// it is none.
inline PointFile read_ply(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  PointFile file;
  std::vector<std::pair<std::string, std::string>> properties;  // type, name
  std::size_t vertices = 0, faces = 0;
  std::string line, element;
  REQUIRE((std::getline(in, line) && line == "ply"));
  REQUIRE((std::getline(in, line) && line == "format binary_little_endian 1.0"));
  while (std::getline(in, line) && line != "end_header") {
    std::istringstream words(line);
    std::string word, type, name;
    words >> word;
    if (word == "comment") file.comments.push_back(line.substr(8));
    if (word == "element") {
      words >> element;
      words >> (element == "vertex" ? vertices : faces);
    }
    if (word == "property" && element == "vertex") {
      words >> type >> name;
      properties.emplace_back(type, name);
    }
    if (word == "property" && element == "face") CHECK(line == "property list uchar int vertex_indices");
  }
  for (std::size_t i = 0; i < vertices; ++i)
    for (const auto& [type, name] : properties) file.columns[name].push_back(detail::read_number(in, type));
  for (std::size_t i = 0; i < faces; ++i) {
    REQUIRE(detail::read_number(in, "uchar") == 3);
    auto& triangle = file.triangles.emplace_back();
    for (int& vertex : triangle) vertex = static_cast<int>(detail::read_number(in, "int"));
  }
  CHECK(in.peek() == std::ifstream::traits_type::eof());
  return file;
}

/// Reads a binary PCD of numbers, as https://pointclouds.org/documentation/tutorials/pcd_file_format.html has
/// it.
inline PointFile read_pcd(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  PointFile file;
  std::map<std::string, std::vector<std::string>> header;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#")) {
      file.comments.push_back(line.substr(2));
      continue;
    }
    std::istringstream words(line);
    std::string key, word;
    words >> key;
    while (words >> word) header[key].push_back(word);
    if (key == "DATA") break;
  }
  REQUIRE(header["DATA"] == std::vector<std::string>{"binary"});
  CHECK(header["VERSION"] == std::vector<std::string>{"0.7"});
  CHECK(header["WIDTH"] == header["POINTS"]);
  CHECK(header["HEIGHT"] == std::vector<std::string>{"1"});
  const auto &fields = header["FIELDS"], &sizes = header["SIZE"], &types = header["TYPE"];
  REQUIRE((fields.size() == sizes.size() && fields.size() == types.size() && header["POINTS"].size() == 1));
  for (std::size_t i = 0; i < std::stoul(header["POINTS"][0]); ++i)
    for (std::size_t f = 0; f < fields.size(); ++f) {
      if (fields[f] != "rgb") {
        file.columns[fields[f]].push_back(detail::read_number(in, types[f] + sizes[f]));
        continue;
      }
      for (const char* colour : {"blue", "green", "red"})  // of a word, lowest byte first
        file.columns[colour].push_back(detail::read_number(in, "uchar"));
      CHECK(detail::read_number(in, "uchar") == 0);
    }
  CHECK(in.peek() == std::ifstream::traits_type::eof());
  return file;
}

}  // namespace dynslam::test
