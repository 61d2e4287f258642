// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/loader/cpu_list.hpp"

namespace redag::doctor {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string &file, const std::string &why) {
  throw Unreadable(fmt::format("{}: {}", printable(file), why));
}

Thread thread_of(const Machine &machine, const Process &process, const std::string &id) {
  const std::string folder = process.file("task/" + id);
  const std::string stat = machine.text(folder + "/stat");
  // "ID (NAME) STATE ...": the name can hold anything, also parentheses. Fields as in proc_pid_stat(5).
  const std::size_t open = stat.find('(');
  const std::size_t close = stat.rfind(')');
  if (open == std::string::npos || close == std::string::npos || close < open) fail(folder, "a thread has no name");
  const std::vector<std::string> fields = words_of(std::string_view(stat).substr(close + 1));
  const auto field = [&](std::size_t number) {
    constexpr std::size_t kFirst = 3;
    const auto value = number - kFirst < fields.size() ? number_in(fields[number - kFirst]) : std::nullopt;
    if (!value || *value < 0 || *value > 99) fail(folder, "the scheduling of a thread is no number");
    return static_cast<int>(*value);
  };
  const auto cpus = parse_cpu_list(machine.value(folder + "/status", "Cpus_allowed_list:"));
  if (!cpus) fail(folder, "the processors of a thread are no list");
  const std::string name = in_quotes(stat.substr(open + 1, close - open - 1));
  return {.id = number_in(id).value_or(0),
          .name = name.substr(1, name.size() - 2),
          .policy = field(41),
          .priority = field(40),
          .cpus = *cpus};
}

}  // namespace

std::string Machine::text(const std::string &file) const {
  constexpr std::size_t kMost = std::size_t{4} << 20U;
  std::error_code error;
  const fs::file_status status = fs::status(path(file), error);
  if (!fs::exists(status)) fail(file, error ? error.message() : "No such file or directory");
  if (!fs::is_regular_file(status)) fail(file, "not a file");  // a pipe would have no end
  errno = 0;
  std::ifstream stream(path(file), std::ios::binary);
  if (!stream) fail(file, std::strerror(errno));
  std::string text;
  std::array<char, 4096> block{};
  while (stream.read(block.data(), block.size()), stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kMost) fail(file, "is longer than 4 MiB");
  }
  if (stream.bad()) fail(file, std::strerror(errno));
  if (text.empty() || (text.back() != '\n' && text.back() != '\0')) fail(file, "is cut off");
  text.resize(text.find_last_not_of(" \t\n") + 1);
  return text;
}

std::int64_t Machine::number(const std::string &file) const {
  const std::string read = text(file);
  const auto value = number_in(read);
  constexpr std::int64_t kMost = 1'000'000'000'000'000;  // microseconds of it are still a Duration
  if (!value || *value < -1 || *value > kMost) fail(file, in_quotes(read) + " is no number of this file");
  return *value;
}

std::vector<int> Machine::processors(const std::string &file) const {
  const std::string read = text(file);
  if (read.empty()) return {};
  auto list = parse_cpu_list(read);
  if (!list) fail(file, in_quotes(read) + " is no list of processors");
  return *std::move(list);
}

std::string Machine::link(const std::string &file) const {
  std::error_code error;
  const fs::path target = fs::read_symlink(path(file), error);
  if (error) fail(file, error.message());
  return target.string();
}

std::string Machine::value(const std::string &file, std::string_view key) const {
  const std::string lines = "\n" + text(file) + "\n";
  const std::size_t at = lines.find("\n" + std::string(key));
  if (at == std::string::npos) fail(file, fmt::format("has no line '{}'", key));
  const std::size_t begin = std::min(lines.find_first_not_of(" \t", at + 1 + key.size()), lines.size() - 1);
  return lines.substr(begin, lines.find('\n', begin) - begin);
}

std::vector<std::string> Machine::names_in(const std::string &folder) const {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(path(folder), error); !error && at != fs::directory_iterator(); at.increment(error)) {
    names.push_back(at->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::int64_t limit_of(const Machine &machine, const Process &process, const char *name) {
  const std::vector<std::string> words = words_of(machine.value(process.file("limits"), name));
  if (words.size() > 1 && words[0] == "unlimited") return kUnlimited;
  const auto value = words.size() > 1 ? number_in(words[0]) : std::nullopt;  // the soft limit, then the hard one
  if (!value || *value < 0) fail(process.file("limits"), fmt::format("'{}' has no value", name));
  return *value;
}

bool has_capability(const Machine &machine, const Process &process, unsigned number) {
  const std::string held = machine.value(process.file("status"), "CapEff:");
  std::uint64_t bits = 0;
  const auto [end, error] = std::from_chars(held.data(), held.data() + held.size(), bits, 16);
  if (error != std::errc() || end != held.data() + held.size()) fail(process.file("status"), "CapEff is no number");
  if ((bits >> number & 1U) == 0) return false;
  return words_of(machine.text(process.file("uid_map"))) == std::vector<std::string>{"0", "0", "4294967295"};
}

std::vector<Thread> threads_of(const Machine &machine, const Process &process) {
  std::vector<Thread> threads;
  for (const std::string &id : machine.names_in(process.file("task"))) {
    try {
      threads.push_back(thread_of(machine, process, id));
    } catch (const Unreadable &) {
      if (!machine.names_in(process.file("task/" + id)).empty()) throw;  // else it has ended meanwhile
    }
  }
  if (threads.empty()) fail(process.file("task"), "shows no thread");
  std::sort(threads.begin(), threads.end(), [](const Thread &a, const Thread &b) { return a.id < b.id; });
  return threads;
}

std::vector<Process> processes_with(const Machine &machine, std::int64_t pid) {
  const auto space_of = [&](const Process &process) -> std::string {
    try {
      return machine.link(process.file("ns/pid"));
    } catch (const Unreadable &) {
      return {};
    }
  };
  const Process wanted{fmt::format("{}", pid)};
  const std::string space = space_of(wanted);
  if (space.empty() || space == space_of({"self"})) return {wanted};
  std::vector<Process> all;
  for (const std::string &name : machine.names_in("/proc")) {
    if (number_in(name) && space_of({name}) == space) all.push_back({name});
  }
  return all;
}

std::optional<std::int64_t> number_in(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::vector<std::string> words_of(std::string_view text) {
  constexpr std::string_view kBlanks{" \t\n\0", 4};
  std::vector<std::string> words;
  for (std::size_t at = text.find_first_not_of(kBlanks); at != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(kBlanks, at), text.size());
    words.emplace_back(text.substr(at, end - at));
    at = text.find_first_not_of(kBlanks, end);
  }
  return words;
}

}  // namespace redag::doctor
