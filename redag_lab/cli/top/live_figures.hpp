// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `redag top` makes of the figures of a frame: sums, verdicts on times, and the rows to show. Rates and shares are
// those of redag/live/rates.hpp. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/live/frame.hpp"
#include "redag/live/rates.hpp"
#include "redag_analysis/text/tint.hpp"

namespace redag::cli {

enum class LiveOrder : std::uint8_t { Dag, Name, Rate, P99, Longest, Misses, Cpu };
inline constexpr std::size_t kLiveOrders = 7;
[[nodiscard]] const char *to_string(LiveOrder order);

struct LiveView {
  LiveOrder order = LiveOrder::Dag;  // Dag: each DAG with its tasks below it; otherwise tasks, the largest first
  bool reversed = false;
  bool dags_only = false;    // the rows of DAGs, in the order of `order`
  bool since_start = false;  // response times and rates of the whole run instead of the recent ones
  std::string filter = {};   // part of the names to show, in any case; empty: all
};

/// A DAG or a task of a frame.
struct LiveRow {
  bool is_dag = false;
  std::size_t index = 0;  // among the frame's DAGs or tasks

  friend bool operator==(const LiveRow &, const LiveRow &) = default;
};

/// Returns the rows that `view` shows, in their order.
[[nodiscard]] std::vector<LiveRow> rows_of(const live::Frame &frame, const LiveView &view);

/// Returns "dag.task" for a task.
[[nodiscard]] std::string full_name(const live::TaskFrame &task, const live::Frame &frame);
[[nodiscard]] std::string full_name(const LiveRow &row, const live::Frame &frame);

/// True if `text` contains `part`, whatever the case of ASCII letters.
[[nodiscard]] bool contains(const std::string &text, const std::string &part);

struct LiveResponse {
  Duration p50 = 0;
  Duration p99 = 0;
  Duration longest = 0;
};
[[nodiscard]] LiveResponse response_of(const live::page::Figures &figures, bool since_start);

/// Returns the released, finished and skipped jobs and misses, also the recent ones, and the jobs away, of all DAGs.
[[nodiscard]] live::page::Figures total_of(const live::Frame &frame);

/// Returns "missed 12 of 2 000 jobs, 3 in the last 5s", in the words of docs/model.md.
[[nodiscard]] std::string misses_in_words(const live::page::Figures &total, Duration window);
/// Returns "9 skipped and 3 late or aborted"; a live page does not tell late jobs from aborted ones. Empty: no misses.
[[nodiscard]] std::string kinds_of_misses(const live::page::Figures &total);
/// Returns what the figures tell about recent misses, and what tells more. Empty: there are none.
[[nodiscard]] std::string hint_on_misses(const live::Frame &frame);

/// Rates a response time: Bad above the deadline or the bound, Caution near the lesser of them. A limit of 0 means
/// none.
[[nodiscard]] Tint response_tint(Duration response, Duration deadline, Duration bound);

/// Returns the age of a frame that should have been replaced; nothing if it is recent.
[[nodiscard]] std::optional<Duration> overdue(const live::Frame &frame, Time now);

}  // namespace redag::cli
