// SPDX-License-Identifier: BSD-3-Clause
// What fuzzing found or kept, and damaged seeds, once more: no crash, no exception but the documented ones.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "fuzz/targets.hpp"
#include "program.hpp"
#include "random.hpp"
#include "run_fixture.hpp"

using namespace dynslam;
namespace fs = std::filesystem;

namespace {

void replay(const fuzz::Target& target, const std::string& input) {
  CHECK_NOTHROW_MESSAGE(target.run({reinterpret_cast<const std::uint8_t*>(input.data()), input.size()}),
                        target.name);
}

}  // namespace

TEST_CASE("whatever parsers are given, they return or say what is wrong with it") {
  test::Rng rng("fuzz replay");
  for (const fuzz::Target& target : fuzz::targets()) {
    CAPTURE(target.name);
    for (const std::string& seed : target.seeds()) {
      REQUIRE_FALSE(seed.empty());
      replay(target, seed);
      const std::size_t step = std::max<std::size_t>(1, seed.size() / 60);
      for (std::size_t n = 0; n < seed.size(); n += step) replay(target, seed.substr(0, n));
      for (int k = 0; k < 150; ++k) {
        std::string damaged = seed;
        for (int bytes = rng.integer(1, 4); bytes > 0; --bytes) {
          const auto at = static_cast<std::size_t>(rng.integer(0, static_cast<int>(seed.size()) - 1));
          damaged[at] = static_cast<char>(k % 3 == 0 ? 0xFF : rng.integer(0, 255));
        }
        replay(target, damaged);
      }
    }
  }
}

TEST_CASE("the corpus that fuzzing left is replayed") {
  const fs::path corpus = DYNSLAM_FUZZ_CORPUS;
  const test::TemporaryFolder unpacked;
  std::set<std::string> names;
  for (const fuzz::Target& target : fuzz::targets()) {
    const std::string name(target.name);
    names.insert(name);
    // Mended findings, and what reaches as much code as everything that was found.
    std::vector<fs::path> folders{corpus / name};
    if (const fs::path archive = corpus / (name + ".tar.gz"); fs::exists(archive)) {
      folders.push_back(unpacked.path / name);
      fs::create_directories(folders.back());
      REQUIRE(test::shell(fmt::format("tar -xzf '{}' -C '{}' 2>&1", archive.string(), folders.back().string()))
                  .code == 0);
    }
    for (const fs::path& folder : folders) {
      if (!fs::exists(folder)) continue;
      for (const auto& file : fs::directory_iterator(folder)) {
        CAPTURE(file.path().string());
        replay(target, test::bytes(file.path()));
      }
    }
  }
  for (const auto& kept : fs::directory_iterator(corpus)) {
    const std::string name = kept.path().filename().string();
    CHECK(names.contains(name.substr(0, name.find('.'))));
  }
}
