// SPDX-License-Identifier: BSD-3-Clause
// What fuzzing found or kept, and damaged seeds, once more: no crash, no exception but the documented ones.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>

#include "fuzz/targets.hpp"
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
  std::set<std::string> names;
  for (const fuzz::Target& target : fuzz::targets()) {
    names.insert(std::string(target.name));
    if (!fs::exists(corpus / target.name)) continue;
    for (const auto& file : fs::directory_iterator(corpus / target.name)) {
      CAPTURE(file.path().string());
      replay(target, test::bytes(file.path()));
    }
  }
  for (const auto& folder : fs::directory_iterator(corpus)) {
    if (folder.is_directory()) CHECK(names.contains(folder.path().filename().string()));
  }
}
