// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/doctor/doctor_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/tint.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_analysis/text/wrap.hpp"

namespace redag::cli {
namespace {

constexpr std::array kVerdicts{doctor::Verdict::Green, doctor::Verdict::Yellow, doctor::Verdict::Red,
                               doctor::Verdict::Unknown};

Tint tint_of(doctor::Verdict verdict) {
  switch (verdict) {
    case doctor::Verdict::Green: return Tint::Good;
    case doctor::Verdict::Yellow: return Tint::Caution;
    case doctor::Verdict::Red: return Tint::Bad;
    case doctor::Verdict::Unknown: return Tint::Faint;
  }
  return Tint::Plain;
}

std::string policy_name(int policy) {
  constexpr std::array kNames{"other", "fifo", "rr", "batch", "4", "idle", "deadline"};
  const auto index = static_cast<std::size_t>(policy);
  return index < kNames.size() ? kNames[index] : fmt::format("{}", policy);
}

// Threads of one kind of scheduling share a row, the most urgent ones first.
Table thread_table(const std::vector<doctor::Thread> &threads) {
  Table table({{.title = "priority", .number = true, .importance = 3},
               {.title = "policy", .importance = 1},
               {.title = "processors", .importance = 2},
               {.title = "threads", .importance = 4, .prose = true}});
  std::map<std::tuple<int, int, std::vector<int>>, std::map<std::string, int>> rows;
  for (const doctor::Thread &thread : threads) {
    ++rows[{-thread.priority, thread.policy, thread.cpus}][thread.name];
  }
  for (const auto &[key, counts] : rows) {
    const auto &[priority, policy, cpus] = key;
    std::vector<std::string> names;
    for (const auto &[name, count] : counts) names.push_back(count == 1 ? name : fmt::format("{} ({})", name, count));
    constexpr std::size_t kShown = 8;
    table.add(
        {{fmt::format("{}", -priority)}, {policy_name(policy)}, {format_cpu_list(cpus)}, {join_first(names, kShown)}});
  }
  return table;
}

// The wake-ups within one octave of latencies.
struct Octave {
  Duration below = 0;
  std::uint64_t count = 0;
};

std::vector<Octave> octaves_of(const HistogramCounts &wake_ups) {
  std::vector<Octave> octaves;
  constexpr std::size_t kBuckets = std::size_t{1} << HistogramCounts::kBits;
  constexpr unsigned kFirst = 7;  // up to 1 us
  for (unsigned octave = kFirst; octave < HistogramCounts::kOctaves; ++octave) {
    const std::size_t from = octave == kFirst ? 0 : octave * kBuckets;
    octaves.push_back(
        {Duration{1} << (octave + HistogramCounts::kBits), wake_ups.count_in(from, (octave + 1) * kBuckets)});
  }
  while (!octaves.empty() && octaves.back().count == 0) octaves.pop_back();
  const auto first = std::find_if(octaves.begin(), octaves.end(), [](const Octave &each) { return each.count > 0; });
  octaves.erase(octaves.begin(), first);
  return octaves;
}

Table wake_up_table(const HistogramCounts &wake_ups) {
  Table table({{.title = "late by less than", .number = true, .importance = 2},
               {.title = "wake-ups", .number = true, .importance = 3},
               {.title = "", .importance = 1}});
  constexpr double kBar = 40;
  for (const Octave &octave : octaves_of(wake_ups)) {
    const double share = static_cast<double>(octave.count) / static_cast<double>(wake_ups.total());
    const auto bar = static_cast<std::size_t>(share * kBar) + (octave.count > 0 ? 1 : 0);
    table.add({{humanize_duration(octave.below)}, {format_count(octave.count)}, {std::string(bar, '#')}});
  }
  return table;
}

Json overheads_json(std::optional<Overheads> overheads) {
  if (!overheads) return nullptr;
  Json json = Json::object();
  for (const std::string_view name : overhead_names()) {
    json[std::string(name) + "_ns"] = *overhead_named(*overheads, name);
  }
  return json;
}

}  // namespace

std::string describe(const doctor::Diagnosis &diagnosis, std::size_t width, bool colour) {
  constexpr std::size_t kIndent = 9;  // after "unknown"
  std::string text;
  for (const doctor::Line &line : diagnosis.lines) {
    const doctor::Verdict verdict = line.finding.verdict;
    const std::string word = to_string(verdict);
    text += tinted(word, tint_of(verdict), colour) + std::string(kIndent - word.size(), ' ') +
            wrapped(fmt::format("{}: {}", line.name, line.finding.found), kIndent, width);
    if (verdict != doctor::Verdict::Yellow && verdict != doctor::Verdict::Red) continue;
    for (const std::string &more : {std::string(line.why), fmt::format("Mend: {}", line.mend)}) {
      text += std::string(kIndent, ' ') + wrapped(more, kIndent, width);
    }
  }
  if (!diagnosis.threads.empty()) text += "\n" + thread_table(diagnosis.threads).render(width, colour);
  std::vector<std::string> counts;
  for (const doctor::Verdict verdict : kVerdicts) {
    if (diagnosis.count(verdict) > 0)
      counts.push_back(fmt::format("{} {}", diagnosis.count(verdict), to_string(verdict)));
  }
  const bool bad = diagnosis.count(doctor::Verdict::Red) > 0;
  const char *const answer = bad                                             ? "mend the red lines"
                             : diagnosis.count(doctor::Verdict::Unknown) > 0 ? "nothing that could be read is red"
                                                                             : "nothing is red";
  return text + "\n" + fitted(fmt::format("{}: {}\n", join(counts), answer), width);
}

std::string describe(const doctor::Measurement &measurement, std::size_t width, bool colour) {
  std::string text = wake_up_table(measurement.wake_ups).render(width, colour) + "\n";
  const auto charged = [&](const char *threads, const std::optional<Overheads> &overheads) {
    if (overheads) text += fmt::format("overheads charged on {} threads: {}\n", threads, to_string(*overheads));
  };
  charged("SCHED_FIFO", measurement.calibration.realtime);
  charged("ordinary", measurement.calibration.normal);
  return fitted(text + "note: a measured maximum is no proof; a longer measurement can find a larger one\n", width);
}

Json to_json(const doctor::Diagnosis &diagnosis, const doctor::Measurement *measurement) {
  Json json = {{"format", "redag.doctor/1"}};
  for (const doctor::Verdict verdict : kVerdicts) json[to_string(verdict)] = diagnosis.count(verdict);
  Json &lines = json["lines"] = Json::array();
  for (const doctor::Line &line : diagnosis.lines) {
    lines.push_back({{"name", line.name},
                     {"verdict", to_string(line.finding.verdict)},
                     {"found", line.finding.found},
                     {"why", line.why},
                     {"mend", line.mend}});
  }
  if (!diagnosis.processes.empty()) {
    Json &processes = json["processes"] = Json::array();
    for (const doctor::Process &process : diagnosis.processes) processes.push_back(process.id);
    Json &threads = json["threads"] = Json::array();
    for (const doctor::Thread &thread : diagnosis.threads) {
      threads.push_back({{"id", thread.id},
                         {"name", thread.name},
                         {"policy", policy_name(thread.policy)},
                         {"priority", thread.priority},
                         {"cpus", thread.cpus}});
    }
  }
  if (measurement != nullptr) {
    const HistogramCounts &wake_ups = measurement->wake_ups;
    Json &latencies = json["wake_ups"] = {{"count", wake_ups.total()},
                                          {"median_ns", wake_ups.quantile(0.5)},
                                          {"p99_ns", wake_ups.quantile(0.99)},
                                          {"longest_ns", wake_ups.longest()}};
    for (const Octave &octave : octaves_of(wake_ups)) {
      latencies["histogram"].push_back({{"below_ns", octave.below}, {"count", octave.count}});
    }
    json["overheads"] = {{"realtime", overheads_json(measurement->calibration.realtime)},
                         {"normal", overheads_json(measurement->calibration.normal)}};
  }
  return json;
}

}  // namespace redag::cli
