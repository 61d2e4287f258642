// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `redag top` makes of the figures of a frame: sums, verdicts on times, and the rows to show. Rates and shares are
// those of redag/live/rates.hpp. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag_analysis/text/tint.hpp"

namespace redag::cli {

enum class LiveOrder : std::uint8_t { Dag, Rate, Longest, Misses, Cpu };
inline constexpr std::size_t kLiveOrders = 5;
[[nodiscard]] const char *to_string(LiveOrder order);

struct LiveView {
  bool all = false;                  // the tasks of all executors
  LiveOrder order = LiveOrder::Dag;  // Dag: each DAG with its tasks below it, or of all executors the most urgent task
                                     // first; otherwise tasks, the largest first
};

/// A DAG or a task of an executor's page.
struct LiveRow {
  const live::Listed *executor;
  const live::DagFrame *dag;
  const live::TaskFrame *task = nullptr;  // null: the row is the DAG's

  [[nodiscard]] const live::Frame &frame() const { return executor->page->frame; }
  [[nodiscard]] const live::page::Figures &figures() const { return task != nullptr ? task->figures : dag->figures; }
  /// Returns "dag.task" for a task.
  [[nodiscard]] std::string name() const;
};

/// Returns the rows of readable pages that `view` shows, in their order. They point into `pages`.
[[nodiscard]] std::vector<LiveRow> rows_of(std::span<const live::Listed> pages, const LiveView &view);

/// Returns "dag.task".
[[nodiscard]] std::string full_name(const live::TaskFrame &task, const live::Frame &frame);

/// Returns the released and finished jobs, misses, processor time, and the jobs away, of all DAGs.
[[nodiscard]] live::page::Figures total_of(const live::Frame &frame);

/// Returns "missed 12 of 2 000 jobs, 3 in the last 5s", in the words of docs/model.md.
[[nodiscard]] std::string misses_in_words(const live::page::Figures &total, Duration window);
/// Returns what the figures tell about recent misses, and what tells more. Empty: there are none.
[[nodiscard]] std::string hint_on_misses(const live::Frame &frame);

/// Rates a response time: Bad above the deadline or the bound, Caution near the lesser of them. A limit of 0 means
/// none.
[[nodiscard]] Tint response_tint(Duration response, Duration deadline, Duration bound);

/// Returns the age of a frame that should have been replaced; nothing if it is recent.
[[nodiscard]] std::optional<Duration> overdue(const live::Frame &frame, Time now);

}  // namespace redag::cli
