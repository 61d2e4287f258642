// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Makes the first, second, third, ... allocation fail, until a run needs no further one. Each time the program must
// report an error ("out of memory", or what a library makes of it) and return 0, 1 or 2, as a child process would. No
// failure may affect the next try.
//
//   redag_allocation_failures FOLDER_OF_WORKLOADS
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string>
#include <vector>

#include "redag_lab/cli/terminal/program.hpp"

namespace {

std::atomic<std::int64_t> left{-1};  // allocations until one fails; negative: none fails

void *allocate(std::size_t size) {
  if (left.load(std::memory_order_relaxed) >= 0 && left.fetch_sub(1) == 0) throw std::bad_alloc();
  if (void *memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}

struct Tried {
  std::uint64_t failures = 0;
  std::uint64_t wrong = 0;
};

// Steps grow. The first allocations set up the program, and each of them is tried. Later ones are alike.
Tried try_all(const std::vector<std::string> &arguments) {
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  Tried tried;
  std::int64_t step = 1;
  for (std::int64_t nth = 0;; nth += step) {
    redag::cli::Console console(nowhere, {}, nowhere, {});
    left.store(nth);
    const int status = redag::cli::run_program(arguments, console);
    const bool failed = left.exchange(-1) < 0;
    if (!failed) break;
    ++tried.failures;
    if (status < 0 || status > 2) ++tried.wrong;
    step = 1 + nth / 400;
  }
  ::close(nowhere);
  return tried;
}

}  // namespace

void *operator new(std::size_t size) { return allocate(size); }
void *operator new[](std::size_t size) { return allocate(size); }
void operator delete(void *memory) noexcept { std::free(memory); }
void operator delete[](void *memory) noexcept { std::free(memory); }
void operator delete(void *memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void *memory, std::size_t) noexcept { std::free(memory); }

int main(int argc, char **argv) {
  if (argc != 2) {
    std::fputs("usage: redag_allocation_failures FOLDER_OF_WORKLOADS\n", stderr);
    return 2;
  }
  const std::string robot = std::string(argv[1]) + "/robot.yaml";
  const std::string hello = std::string(argv[1]) + "/hello.yaml";
  const std::vector<std::vector<std::string>> commands = {
      // Without --json: nlohmann::json 3.11 allocates when it destroys a tree, and such a failure cannot be handled.
      {"validate", robot},
      {"simulate", hello, "--duration", "20ms"},
      {"analyze", robot},
      {"generate", "--dags", "2"},
  };
  std::uint64_t wrong = 0;
  for (const auto &arguments : commands) {
    std::printf("%-9s ", arguments.front().c_str());
    std::fflush(stdout);
    const Tried tried = try_all(arguments);
    std::printf("%8llu failed allocations, %llu wrong ends\n", static_cast<unsigned long long>(tried.failures),
                static_cast<unsigned long long>(tried.wrong));
    wrong += tried.wrong;
  }
  return wrong == 0 ? 0 : 1;
}
