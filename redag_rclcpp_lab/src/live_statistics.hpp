// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Live pages as names with values, the form of pal_statistics_msgs (docs/ros2.md, "PlotJuggler"). A name is
// EXECUTOR/DAG/CALLBACK/FIGURE, with the figures of `redag top --json` in seconds. A value that remembers which
// executor has which name, and the names before. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_set>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/live/reader.hpp"

namespace redag_rclcpp::lab {

/// Most values of executors in one message. A thousand callbacks with their DAGs have about 30,000.
inline constexpr std::size_t kMostStatistics = 65'536;

class LiveStatistics {
 public:
  /// `figures`: those to show, of known_figures(); empty: all. `first_version` should differ from those of earlier
  /// processes, because readers keep names by their version.
  LiveStatistics(std::set<std::string, std::less<>> figures, std::uint32_t first_version,
                 std::size_t most = kMostStatistics);

  /// Takes the figures of `pages` at `now` (CLOCK_MONOTONIC). Returns true if the names have changed, and with them the
  /// version.
  bool update(const std::vector<redag::live::Listed> &pages, redag::Time now);

  /// Each name stands there once. The executor that began first comes first.
  [[nodiscard]] const std::vector<std::string> &names() const { return names_; }
  /// In the order of the names.
  [[nodiscard]] const std::vector<double> &values() const { return values_; }
  [[nodiscard]] std::uint32_t version() const { return version_; }

 private:
  using Key = std::tuple<std::int64_t, std::uint64_t, std::uint32_t>;  // pid, start of the process, number

  void name_executors(const std::vector<const redag::live::Listed *> &pages);
  void add_executor(const redag::live::Listed &listed, redag::Time now);
  template <class Row, class Columns>
  void add_row(std::string_view prefix, const Row &row, const redag::live::Frame &frame, const Columns &columns);
  /// Adds a value if its figure is selected and there is room.
  void add(std::string_view prefix, const char *figure, double value);
  void put(std::string_view prefix, const char *figure, double value);
  /// Returns `parts` with a slash behind each of them, and a number if a row before has the same ones.
  [[nodiscard]] std::string prefix_of(std::initializer_list<std::string_view> parts);

  const std::set<std::string, std::less<>> figures_;
  const std::size_t most_;
  std::map<Key, std::string> executors_;  // their names, while they live
  std::unordered_set<std::string> prefixes_;
  std::vector<std::string> names_;
  std::vector<double> values_;
  std::uint32_t version_;
  std::size_t left_out_ = 0;
  bool has_changed_ = false;
  std::string scratch_;
};

/// Returns all figures, sorted.
[[nodiscard]] std::set<std::string, std::less<>> known_figures();

}  // namespace redag_rclcpp::lab
