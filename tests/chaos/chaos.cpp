// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

//   redag_chaos simulator|executor [RUNS [FIRST_SEED]]
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "tests/chaos/chaos.hpp"

int main(int argc, char **argv) {
  using namespace redag::chaos;
  const std::string_view kind = argc > 1 ? argv[1] : "";
  const bool simulator = kind == "simulator";
  if (!simulator && kind != "executor") {
    std::fputs("usage: redag_chaos simulator|executor [RUNS [FIRST_SEED]]\n", stderr);
    return 2;
  }
  const std::uint64_t runs = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : simulator ? 500 : 60;
  const std::uint64_t first = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  Survived survived;
  int broken = 0;
  for (std::uint64_t seed = first; seed < first + runs; ++seed) {
    const std::string why = simulator ? simulator_run(seed, survived) : executor_run(seed, survived);
    if (why.empty()) continue;
    ++broken;
    std::fprintf(stderr, "seed %llu (redag_chaos %s 1 %llu):\n%s\n", static_cast<unsigned long long>(seed), argv[1],
                 static_cast<unsigned long long>(seed), why.c_str());
  }
  std::printf("%llu runs, %d broken\n", static_cast<unsigned long long>(runs), broken);
  for (const auto &[what, count] : survived) {
    std::printf("  %-44s %12llu\n", what.c_str(), static_cast<unsigned long long>(count));
  }
  return broken == 0 ? 0 : 1;
}
