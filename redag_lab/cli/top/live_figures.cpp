// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "redag/base/text.hpp"
#include "redag/base/words.hpp"

namespace redag::cli {
namespace {

using live::DagFrame;
using live::Frame;
using live::TaskFrame;
using live::page::Figures;

constexpr double kNear = 0.9;      // share of the limit that counts as near
constexpr int kMissedUpdates = 4;  // after which a page is stale
constexpr Duration kPatience = kSecond;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

const Figures &figures_of(const LiveRow &row, const Frame &frame) {
  return row.is_dag ? frame.dags[row.index].figures : frame.tasks[row.index].figures;
}

double key_of(const LiveRow &row, const Frame &frame, const LiveView &view) {
  const Figures &figures = figures_of(row, frame);
  const LiveResponse response = response_of(figures, view.since_start);
  switch (view.order) {
    case LiveOrder::Rate: return rate_of(figures, frame, view.since_start);
    case LiveOrder::P99: return static_cast<double>(response.p99);
    case LiveOrder::Longest: return static_cast<double>(response.longest);
    // Recent misses outrank earlier ones.
    case LiveOrder::Misses:
      return static_cast<double>(figures.recent_misses) * 1e12 + static_cast<double>(figures.misses);
    case LiveOrder::Cpu: return cpu_of(figures, frame, view.since_start);
    case LiveOrder::Dag:
    case LiveOrder::Name: break;
  }
  return 0;
}

std::vector<LiveRow> by_dag(const Frame &frame, const LiveView &view) {
  std::vector<LiveRow> rows;
  for (std::size_t i = 0; i < frame.dags.size(); ++i) {
    const std::size_t d = view.reversed ? frame.dags.size() - 1 - i : i;
    const std::size_t at = rows.size();
    for (std::size_t t = 0; t < frame.tasks.size(); ++t) {
      if (frame.tasks[t].dag == d && contains(full_name(frame.tasks[t], frame), view.filter))
        rows.push_back({false, t});
    }
    // A DAG is shown with any of its tasks.
    if (rows.size() > at || contains(frame.dags[d].name, view.filter)) {
      rows.insert(rows.begin() + static_cast<std::ptrdiff_t>(at), LiveRow{true, d});
    }
  }
  return rows;
}

}  // namespace

const char *to_string(LiveOrder order) {
  constexpr std::array<const char *, kLiveOrders> kNames{"dag", "name", "rate", "p99", "max", "misses", "cpu"};
  return kNames[static_cast<std::size_t>(order)];
}

bool contains(const std::string &text, const std::string &part) {
  const auto same = [](char a, char b) { return lower(a) == lower(b); };
  return std::search(text.begin(), text.end(), part.begin(), part.end(), same) != text.end() || part.empty();
}

std::string full_name(const TaskFrame &task, const Frame &frame) {
  const std::string &dag = frame.dags[task.dag].name;
  return dag.empty() ? task.name : dag + "." + task.name;
}

std::string full_name(const LiveRow &row, const Frame &frame) {
  return row.is_dag ? frame.dags[row.index].name : full_name(frame.tasks[row.index], frame);
}

std::vector<LiveRow> rows_of(const Frame &frame, const LiveView &view) {
  if (view.order == LiveOrder::Dag && !view.dags_only) return by_dag(frame, view);
  std::vector<LiveRow> rows;
  const std::size_t count = view.dags_only ? frame.dags.size() : frame.tasks.size();
  for (std::size_t i = 0; i < count; ++i) {
    const LiveRow row{view.dags_only, i};
    if (contains(full_name(row, frame), view.filter)) rows.push_back(row);
  }
  std::stable_sort(rows.begin(), rows.end(), [&](const LiveRow &a, const LiveRow &b) {
    if (view.order == LiveOrder::Name) return full_name(a, frame) < full_name(b, frame);
    return key_of(a, frame, view) > key_of(b, frame, view);
  });
  if (view.reversed) std::reverse(rows.begin(), rows.end());
  return rows;
}

LiveResponse response_of(const Figures &figures, bool since_start) {
  if (since_start) return {figures.response_p50, figures.response_p99, figures.response_max};
  return {figures.recent_p50, figures.recent_p99, figures.recent_max};
}

Figures total_of(const Frame &frame) {
  Figures total{};
  for (const DagFrame &dag : frame.dags) {
    total.released += dag.figures.released;
    total.finished += dag.figures.finished;
    total.skipped += dag.figures.skipped;
    total.misses += dag.figures.misses;
    total.cpu += dag.figures.cpu;
    total.recent_jobs += dag.figures.recent_jobs;
    total.recent_misses += dag.figures.recent_misses;
    total.recent_cpu += dag.figures.recent_cpu;
    total.away += dag.figures.away;
  }
  return total;
}

std::string misses_in_words(const Figures &total, Duration window) {
  if (total.misses == 0) return "no deadline missed, of " + plural(total.released, "job");
  return fmt::format("missed {} of {}, {} in the last {}", format_count(total.misses), plural(total.released, "job"),
                     format_count(total.recent_misses), humanize_duration(window));
}

std::string kinds_of_misses(const Figures &total) {
  std::vector<std::string> kinds;
  if (total.skipped > 0) kinds.push_back(format_count(total.skipped) + " skipped");
  if (total.misses > total.skipped) kinds.push_back(format_count(total.misses - total.skipped) + " late or aborted");
  return join(kinds);
}

std::string hint_on_misses(const Frame &frame) {
  constexpr double kBusy = 0.95;
  const auto worst = std::max_element(frame.dags.begin(), frame.dags.end(), [](const DagFrame &a, const DagFrame &b) {
    return a.figures.recent_misses < b.figures.recent_misses;
  });
  if (worst == frame.dags.end() || worst->figures.recent_misses == 0) return {};
  std::string text = "most misses lately: " + worst->name;
  if (worst->max_active > 0 && worst->figures.active >= worst->max_active) text += ", at its max_active";
  const double busy = frame.workers > 0 ? cpu_of(total_of(frame), frame, false) / frame.workers : 0;
  if (busy >= kBusy) text += fmt::format(", workers busy {}", format_percent(busy));
  return text + "; redag why explains a recorded run";
}

Tint response_tint(Duration response, Duration deadline, Duration bound) {
  Duration limit = kNever;
  if (deadline > 0) limit = std::min(limit, deadline);
  if (bound > 0) limit = std::min(limit, bound);
  if (limit == kNever) return Tint::Plain;
  if (response > limit) return Tint::Bad;
  return static_cast<double>(response) >= kNear * static_cast<double>(limit) ? Tint::Caution : Tint::Plain;
}

std::optional<Duration> overdue(const Frame &frame, Time now) {
  const Duration age = now - frame.published;
  const Duration patience =
      std::max(kPatience, std::min(frame.interval, kMaxDuration / kMissedUpdates) * kMissedUpdates);
  if (age <= patience) return std::nullopt;
  return age;
}

}  // namespace redag::cli
