// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "counted.hpp"

#include <gnu/libc-version.h>
#include <sys/utsname.h>

#include <cstdio>
#include <cstdlib>

namespace redag::benchmarks {
namespace {

std::string compiled_by() {
#ifdef __clang__
  return "clang " + std::to_string(__clang_major__);
#else
  return "GCC " + std::to_string(__GNUC__);
#endif
}

void print_environment(std::string_view more) {
  utsname machine{};
  uname(&machine);
  std::printf("environment: %s, %s, %s, glibc %s%s%.*s\n", compiled_by().c_str(), REDAG_COUNTED_FLAGS, machine.machine,
              gnu_get_libc_version(), more.empty() ? "" : ", ", static_cast<int>(more.size()), more.data());
}

}  // namespace

int run_counted(int argc, char **argv, const std::vector<Case> &cases, std::string_view environment) {
  if (argc == 2 && std::string_view(argv[1]) == "--list") {
    print_environment(environment);
    for (const Case &one : cases) std::printf("%s\n", one.name.c_str());
    return 0;
  }
  for (const Case &one : cases) {
    if (argc != 3 || one.name != argv[1]) continue;
    const std::uint64_t operations = one.run(std::strtoull(argv[2], nullptr, 10));
    if (operations == 0) return 3;
    std::printf("%llu\n", static_cast<unsigned long long>(operations));
    return 0;
  }
  std::fprintf(stderr, "usage: %s --list | CASE LEAST\n", argv[0]);
  return 2;
}

}  // namespace redag::benchmarks
