// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Formats a frame of a live page: lines with a table for people, JSON for programs. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag_analysis/text/tint.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"

namespace redag::cli {

enum class LiveOrder : std::uint8_t { Dag, Name, Rate, P99, Longest, Misses, Cpu };
inline constexpr std::size_t kLiveOrders = 7;
[[nodiscard]] const char *to_string(LiveOrder order);

struct LiveView {
  LiveOrder order = LiveOrder::Dag;  // Dag: each DAG with its tasks below it; otherwise tasks, the largest first
  bool reversed = false;
  bool dags_only = false;
  bool since_start = false;  // response times and rates of the whole run instead of the recent ones
};

/// The lines above the table, the titles of its columns, and one line per row.
struct LiveText {
  std::vector<std::string> head;
  std::string titles;
  std::vector<std::string> rows;
};

/// `now` is CLOCK_MONOTONIC.
[[nodiscard]] LiveText describe(const live::Listed &listed, const live::Page &page, const LiveView &view,
                                const StreamTraits &terminal, Time now);

/// Rates a response time: Bad above the deadline or the bound, Caution near the lesser of them. A limit of 0 means
/// none.
[[nodiscard]] Tint response_tint(Duration response, Duration deadline, Duration bound);

/// Returns the age of a frame that should have been replaced; nothing if it is recent.
[[nodiscard]] std::optional<Duration> overdue(const live::Frame &frame, Time now);

/// Returns "redag.live/1" (docs/live_page.md).
[[nodiscard]] Json to_json(const live::Listed &listed, const live::Page &page, Time now);
/// Returns "redag.live-list/1".
[[nodiscard]] Json to_json(const std::vector<live::Listed> &pages, Time now);

/// Returns one line per executor.
[[nodiscard]] std::string describe(const std::vector<live::Listed> &pages, const StreamTraits &terminal, Time now);

}  // namespace redag::cli
