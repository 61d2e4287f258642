// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/overheads.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "redag/base/int128.hpp"

namespace redag {
namespace {

using Member = Duration &(*)(Overheads &);

struct Name {
  std::string_view name;
  Member member;
};

// The only list of the overheads, for the text form and for the file.
constexpr std::array kNames = {
    Name{"timer", [](Overheads &o) -> Duration & { return o.timer; }},
    Name{"dispatch", [](Overheads &o) -> Duration & { return o.dispatch; }},
    Name{"preempt", [](Overheads &o) -> Duration & { return o.preempt; }},
    Name{"lateness", [](Overheads &o) -> Duration & { return o.lateness; }},
    Name{"stall", [](Overheads &o) -> Duration & { return o.stall.longest; }},
    Name{"stall_per_second", [](Overheads &o) -> Duration & { return o.stall.per_second; }},
    Name{"noise", [](Overheads &o) -> Duration & { return o.noise.longest; }},
    Name{"noise_per_second", [](Overheads &o) -> Duration & { return o.noise.per_second; }},
    Name{"clock", [](Overheads &o) -> Duration & { return o.clock; }},
};

}  // namespace

Duration Loss::in(Duration window) const {
  const Int128 all = Int128{longest} + (Int128{window} * per_second + kSecond - 1) / kSecond;
  return static_cast<Duration>(std::min(all, Int128{kMaxDuration}));
}

Duration *overhead_named(Overheads &overheads, std::string_view name) {
  const auto *found = std::find_if(kNames.begin(), kNames.end(), [&](const Name &one) { return one.name == name; });
  return found == kNames.end() ? nullptr : &found->member(overheads);
}

const std::vector<std::string_view> &overhead_names() {
  static const std::vector<std::string_view> kAll = [] {
    std::vector<std::string_view> names;
    names.reserve(kNames.size());
    for (const Name &one : kNames) names.push_back(one.name);
    return names;
  }();
  return kAll;
}

std::string to_string(const Overheads &overheads) {
  Overheads copy = overheads;
  std::string text;
  for (const Name &one : kNames) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", one.name, format_duration(one.member(copy)));
  }
  return text;
}

std::optional<Overheads> parse_overheads(std::string_view text) {
  Overheads overheads;
  for (const Name &one : kNames) {
    const std::size_t comma = std::min(text.find(", "), text.size());
    const std::string_view part = text.substr(0, comma);
    text.remove_prefix(std::min(text.size(), comma + 2));
    if (part.size() <= one.name.size() + 1 || part.substr(0, one.name.size()) != one.name ||
        part[one.name.size()] != ' ') {
      return std::nullopt;
    }
    const Result<Duration> value = parse_duration(part.substr(one.name.size() + 1));
    if (!value || *value < 0) return std::nullopt;
    one.member(overheads) = *value;
  }
  return text.empty() ? std::optional(overheads) : std::nullopt;
}

const Overheads &plausible_overheads() {
  // The longest stall is a time slice of a kernel without real-time patches. All stalls take 2 % of a processor.
  static const Overheads kPlausible{.timer = 20 * kMicrosecond,
                                    .dispatch = 200 * kMicrosecond,
                                    .preempt = 100 * kMicrosecond,
                                    .lateness = 1 * kMillisecond,
                                    .stall = {5 * kMillisecond, 20 * kMillisecond},
                                    .noise = {1 * kMillisecond, 10 * kMillisecond},
                                    .clock = 2 * kMicrosecond};
  return kPlausible;
}

}  // namespace redag
