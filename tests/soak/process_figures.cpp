// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/soak/process_figures.hpp"

#include <malloc.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>

namespace redag::soak {
namespace {

double entries_of(const char *folder) {
  double count = 0;
  std::error_code ignored;
  for ([[maybe_unused]] const auto &entry : std::filesystem::directory_iterator(folder, ignored)) ++count;
  return count;
}

// Counts voluntary switches: a thread that wakes up has slept before.
std::uint64_t wake_ups_of_others() {
  const std::string self = std::to_string(::syscall(SYS_gettid));
  std::uint64_t all = 0;
  std::error_code ignored;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    if (entry.path().filename() == self) continue;
    std::ifstream status(entry.path() / "status");
    for (std::string key; status >> key;) {
      std::uint64_t switches = 0;
      if (key == "voluntary_ctxt_switches:" && status >> switches) all += switches;
    }
  }
  return all;
}

}  // namespace

ProcessFigures process_figures() {
  ProcessFigures figures;
  const struct mallinfo2 heap = ::mallinfo2();
  figures.heap_kib = static_cast<double>(heap.uordblks + heap.hblkhd) / 1024;
  std::ifstream statm("/proc/self/statm");
  double total = 0;
  double resident = 0;
  statm >> total >> resident;
  figures.resident_kib = resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1024;
  figures.threads = entries_of("/proc/self/task");
  figures.files = entries_of("/proc/self/fd");
  figures.wake_ups = wake_ups_of_others();
  timespec cpu{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
  figures.cpu = cpu.tv_sec * 1'000'000'000 + cpu.tv_nsec;
  return figures;
}

}  // namespace redag::soak
