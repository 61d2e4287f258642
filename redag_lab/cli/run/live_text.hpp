// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A frame of a live page as people and programs read it: lines with a table, or JSON. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
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
  bool since_start = false;  // response times and rates of the whole run, and not the recent ones
};

/// What is above the table; then the titles of its columns, and a line a row.
struct LiveText {
  std::vector<std::string> head;
  std::string titles;
  std::vector<std::string> rows;
};

/// `now`: CLOCK_MONOTONIC.
[[nodiscard]] LiveText describe(const live::Listed &listed, const live::Page &page, const LiveView &view,
                                const StreamTraits &terminal, Time now);

/// Is a response time an alarm: beyond the deadline or the bound (Bad), or near the lesser of them (Caution)? 0: none.
[[nodiscard]] Tint response_tint(Duration response, Duration deadline, Duration bound);

/// How long nobody has written although it was time; nothing while all is well.
[[nodiscard]] std::optional<Duration> overdue(const live::Frame &frame, Time now);

/// "redag.live/1" (docs/live_page.md).
[[nodiscard]] Json to_json(const live::Listed &listed, const live::Page &page, Time now);
/// "redag.live-list/1".
[[nodiscard]] Json to_json(const std::vector<live::Listed> &pages, Time now);

/// One line an executor.
[[nodiscard]] std::string describe(const std::vector<live::Listed> &pages, const StreamTraits &terminal, Time now);

}  // namespace redag::cli
