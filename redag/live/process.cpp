// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/process.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <charconv>
#include <fstream>
#include <sstream>
#include <utility>

namespace redag::live {
namespace {

std::string stat_of(std::int64_t pid) { return text_of_proc(fmt::format("/proc/{}/stat", pid)); }

bool is_zombie(const std::string &stat) {
  const std::size_t end = stat.rfind(')');
  return end != std::string::npos && end + 2 < stat.size() && (stat[end + 2] == 'Z' || stat[end + 2] == 'X');
}

std::uint64_t own_namespace() {
  struct stat info {};
  return ::stat("/proc/self/ns/pid", &info) == 0 ? static_cast<std::uint64_t>(info.st_ino) : 0;
}

}  // namespace

std::string text_of_proc(const std::string &path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();  // A std::istreambuf_iterator would throw if the process ends between the two calls.
  return std::move(text).str();
}

std::optional<std::uint64_t> start_time_in(const std::string &stat) {
  // The form is "PID (program) state ppid ...". The program's name can hold anything, also ") 1 2 3".
  std::size_t at = stat.rfind(')');
  constexpr int kField = 22;
  for (int field = 2; field < kField && at != std::string::npos; ++field) at = stat.find(' ', at + 1);
  if (at == std::string::npos) return std::nullopt;
  std::uint64_t ticks = 0;
  const char *const end = stat.data() + stat.size();
  const auto parsed = std::from_chars(stat.data() + at + 1, end, ticks);
  if (parsed.ec != std::errc() || (parsed.ptr != end && *parsed.ptr != ' ')) return std::nullopt;
  return ticks;
}

Process this_process() { return {getpid(), start_time_in(stat_of(getpid())).value_or(0), own_namespace()}; }

Life life_of(const Process &process) {
  if (process.pid_namespace != own_namespace()) return Life::Unknown;
  if (process.pid <= 0) return Life::Dead;
  const std::string stat = stat_of(process.pid);
  const auto start = start_time_in(stat);
  return start && *start == process.start && !is_zombie(stat) ? Life::Alive : Life::Dead;
}

}  // namespace redag::live
