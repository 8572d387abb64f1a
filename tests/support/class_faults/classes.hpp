// SPDX-License-Identifier: BSD-3-Clause
// What scripts/check-classes.sh must find with MAX_PRIVATE=3 and MAX_DATA=4: four faults.
#pragma once

#include <functional>
#include <map>
#include <vector>

namespace faults {

class Many {  // 1: private methods, 2: data members
 public:
  Many();
  Many(const Many&) = delete;
  [[nodiscard]] int one() const { return a_ + (b_ > 0 ? 1 : 0); }
  static int not_counted_;

 private:
  struct Nested;
  enum class Kind { a, b, c };
  using Numbers = std::vector<int>;
  friend class Small;
  void first();
  [[nodiscard]] static int second(int a = 3, int b = {});
  template <class T>
  void third(const T& value) {
    if (value) {
      first();
    }
  }
  bool operator<(const Many& other) const;
  static constexpr int kNotCounted = 3;

  int a_ = 0, b_ = 0;
  std::map<int, std::function<void(int, int)>> functions_;  // with a ; and a {
  Numbers numbers_{1, 2, 3};
  char brace_ = '{';
};

struct Many::Nested {  // 3: data members of a struct that has a constructor
  explicit Nested(int of) : a(of), b(of) {}
  int a, b, c = 0, d = 0;
  std::vector<int> e = {1, 2};
};

class Derived final : public Many {  // 4: the private part of a class begins at once
  void first();
  void second();
  void third();
  void fourth();

 protected:
  int member_;
};

struct Options {  // fields alone: as many as it needs
  int a, b, c, d, e, f;
  [[nodiscard]] bool ok() const { return a > 0; }
};

class Small {
 public:
  void a();
  void b();
  void c();
  void d();

 private:
  void first();
  void second();
  void third();
  int a_, b_, c_, d_;
};

}  // namespace faults
