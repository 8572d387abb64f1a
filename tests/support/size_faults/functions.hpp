// SPDX-License-Identifier: BSD-3-Clause
// What scripts/check-sizes.sh must find with MAX_FUNCTION=8: four functions, and the file with MAX_FILE=40.
#pragma once

namespace faults {

struct Type {
  explicit Type(int a) : a_(a) {  // 1: a constructor
    ++a_;
    ++a_;
    ++a_;
    ++a_;
    ++a_;
    ++a_;
    ++a_;
  }
  int short_one() const {
    return a_;
  }

 private:
  int a_;
};

template <class T>
  requires(sizeof(T) > 1)
T of_nine_lines_with_its_head(const T& a,
                              const T& b) {  // 2: a template
  if (a) {
    for (;;) {
      return b;
    }
  }
  return a;
}

namespace {

int with_lambdas(int a) {  // 3
  const auto f = [&] {
    return a;
  };
  const int many[] = {
      1,
      2,
  };
  return f() + many[0];
}

}  // namespace

inline bool operator==(const Type&, const Type&) {  // 4
  if (true) {
    return false;
  } else {
    return true;
  }
  // what is said here counts
  // as lines, too
}

enum class Not { a, function };

inline int just_short_enough() {
  return 1 +
         2 +
         3 +
         4 +
         5 +
         6;
}

struct NoFunction {
  int a;
  int b;
  int c;
  int d;
  int e;
  int f;
  int g;
};

}  // namespace faults
