// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/live/rates.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::cli {
namespace {

using live::DagFrame;
using live::Frame;
using live::TaskFrame;
using live::page::Figures;

constexpr double kNear = 0.9;      // share of the limit that counts as near
constexpr int kMissedUpdates = 4;  // after which a page is stale
constexpr Duration kPatience = kSecond;

double key_of(const LiveRow &row, LiveOrder order) {
  const Figures &figures = row.figures();
  switch (order) {
    case LiveOrder::Rate: return rate_of(figures, row.frame());
    case LiveOrder::Longest: return static_cast<double>(figures.recent_max);
    // Recent misses outrank earlier ones.
    case LiveOrder::Misses:
      return static_cast<double>(figures.recent_misses) * 1e12 + static_cast<double>(figures.misses);
    case LiveOrder::Cpu: return cpu_of(figures, row.frame());
    case LiveOrder::Dag: break;
  }
  return 0;
}

// The kernel's order of all tasks: by priority, and tasks without a priority of their own last; then by period.
std::pair<int, Duration> urgency(const LiveRow &row) { return {-row.task->priority, row.task->period}; }

}  // namespace

const char *to_string(LiveOrder order) {
  constexpr std::array<const char *, kLiveOrders> kNames{"dag", "rate", "max", "misses", "cpu"};
  return kNames[static_cast<std::size_t>(order)];
}

std::string full_name(const TaskFrame &task, const Frame &frame) {
  const std::string &dag = frame.dags[task.dag].name;
  return dag.empty() ? task.name : dag + "." + task.name;
}

std::string LiveRow::name() const { return task != nullptr ? full_name(*task, frame()) : dag->name; }

std::vector<LiveRow> rows_of(std::span<const live::Listed> pages, const LiveView &view) {
  const bool by_dag = view.order == LiveOrder::Dag && !view.all;
  std::vector<LiveRow> rows;
  for (const live::Listed &listed : pages) {
    if (!listed.page) continue;
    const Frame &frame = listed.page->frame;
    for (std::size_t d = 0; d < frame.dags.size(); ++d) {
      if (by_dag) rows.push_back({&listed, &frame.dags[d]});
      for (const TaskFrame &task : frame.tasks) {
        if (task.dag == d) rows.push_back({&listed, &frame.dags[d], &task});
      }
    }
  }
  if (by_dag) return rows;
  std::stable_sort(rows.begin(), rows.end(), [&](const LiveRow &a, const LiveRow &b) {
    if (view.order == LiveOrder::Dag) return urgency(a) < urgency(b);
    return key_of(a, view.order) > key_of(b, view.order);
  });
  return rows;
}

Figures total_of(const Frame &frame) {
  Figures total{};
  for (const DagFrame &dag : frame.dags) {
    total.released += dag.figures.released;
    total.finished += dag.figures.finished;
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

std::string hint_on_misses(const Frame &frame) {
  constexpr double kBusy = 0.95;
  const auto worst = std::max_element(frame.dags.begin(), frame.dags.end(), [](const DagFrame &a, const DagFrame &b) {
    return a.figures.recent_misses < b.figures.recent_misses;
  });
  if (worst == frame.dags.end() || worst->figures.recent_misses == 0) return {};
  std::string text = "most misses lately: " + worst->name;
  if (worst->max_active > 0 && worst->figures.active >= worst->max_active) text += ", at its max_active";
  const double busy = frame.workers > 0 ? cpu_of(total_of(frame), frame) / frame.workers : 0;
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
