// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a target on files, and on the files of folders: the corpus as a test, or a crash again in a debugger.
//
//   redag_fuzz_replay <target> <file or folder>...
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/fuzz/targets.hpp"

namespace {

namespace fs = std::filesystem;
using redag::fuzz::kTargets;

// Limit in processor time, on any machine and under sanitizers. Bad input costs milliseconds.
constexpr double kMostSeconds = 20;

std::vector<fs::path> files_of(const std::vector<std::string> &places) {
  std::vector<fs::path> files;
  for (const std::string &place : places) {
    if (!fs::is_directory(place)) {
      files.emplace_back(place);
      continue;
    }
    for (const auto &entry : fs::directory_iterator(place)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

int replay(const redag::fuzz::Target &target, const std::vector<fs::path> &files) {
  int slow = 0;
  for (const fs::path &file : files) {
    std::ifstream stream(file, std::ios::binary);
    const std::string input{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (!stream) {
      std::fprintf(stderr, "%s: cannot be read\n", file.c_str());
      return 2;
    }
    std::fprintf(stderr, "%s\n", file.filename().c_str());  // after a crash, the last name is that of the file
    const double begin = cpu_seconds();
    target.run(input);
    const double seconds = cpu_seconds() - begin;
    if (seconds <= kMostSeconds) continue;
    std::fprintf(stderr, "  took %.1f s of processor time, more than %.0f\n", seconds, kMostSeconds);
    ++slow;
  }
  std::printf("%.*s: %zu inputs\n", static_cast<int>(target.name.size()), target.name.data(), files.size());
  return slow == 0 && !files.empty() ? 0 : 1;
}

}  // namespace

int main(int argc, char **argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  const auto target = std::find_if(kTargets.begin(), kTargets.end(), [&](const redag::fuzz::Target &each) {
    return !arguments.empty() && each.name == arguments.front();
  });
  if (target == kTargets.end() || arguments.size() < 2) {
    std::fputs("usage: redag_fuzz_replay TARGET FILE_OR_FOLDER...; targets:", stderr);
    for (const redag::fuzz::Target &each : kTargets) std::fprintf(stderr, " %s", std::string(each.name).c_str());
    std::fputs("\n", stderr);
    return 2;
  }
  return replay(*target, files_of({arguments.begin() + 1, arguments.end()}));
}
