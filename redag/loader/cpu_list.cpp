// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/cpu_list.hpp"

#include <algorithm>
#include <charconv>

namespace redag {
namespace {

// Parses a number at the start of `text` and removes it from there.
std::optional<int> take_number(std::string_view &text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || value < 0 || value > kMaxCpu) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

}  // namespace

std::optional<std::vector<int>> parse_cpu_list(std::string_view text) {
  std::vector<bool> listed(kMaxCpu + 1, false);
  while (true) {
    const std::optional<int> first = take_number(text);
    if (!first) return std::nullopt;
    int last = *first;
    if (!text.empty() && text.front() == '-') {
      text.remove_prefix(1);
      const std::optional<int> given = take_number(text);
      if (!given || *given < *first) return std::nullopt;
      last = *given;
    }
    std::fill(listed.begin() + *first, listed.begin() + last + 1, true);
    if (text.empty()) break;
    if (text.front() != ',') return std::nullopt;
    text.remove_prefix(1);
  }
  std::vector<int> cpus;
  for (int cpu = 0; cpu <= kMaxCpu; ++cpu) {
    if (listed[static_cast<std::size_t>(cpu)]) cpus.push_back(cpu);
  }
  return cpus;
}

std::string format_cpu_list(const std::vector<int> &cpus) {
  std::string text;
  for (std::size_t i = 0; i < cpus.size();) {
    std::size_t last = i;
    while (last + 1 < cpus.size() && cpus[last + 1] == cpus[last] + 1) ++last;
    if (!text.empty()) text += ',';
    text += std::to_string(cpus[i]);
    if (last > i) text += '-' + std::to_string(cpus[last]);
    i = last + 1;
  }
  return text;
}

}  // namespace redag
