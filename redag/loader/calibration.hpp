// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The overheads of a machine, where they come from, and the file that holds them (docs/calibration.md). Plain values.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/derived/overheads.hpp"

namespace redag {

/// A machine's overheads, and their provenance.
struct Calibration {
  std::optional<Overheads> realtime;  // SCHED_FIFO threads; empty: the process had no right to them
  std::optional<Overheads> normal;
  std::string date;  // UTC, ISO 8601
  std::string host;
  std::string kernel;
  std::string processor;
  std::string rights;  // "SCHED_FIFO up to 98", "none"
  std::string version;
  Duration duration = 0;
  std::uint32_t processors = 0;
  bool complete = true;  // false: ended early, with the maxima until then

  /// For example "overheads of 2026-11-23T08:30:00Z on host (30s)".
  [[nodiscard]] std::string provenance() const;
  /// Returns the overheads charged to jobs on such threads. Error: they were not measured.
  [[nodiscard]] Result<Overheads> of(bool realtime_threads) const;

  friend bool operator==(const Calibration &, const Calibration &) = default;
};

[[nodiscard]] std::string to_yaml(const Calibration &calibration);
/// Errors: all mistakes by line, or why the file cannot be read.
[[nodiscard]] Result<Calibration> load_calibration(const std::filesystem::path &path);
[[nodiscard]] Result<Calibration> parse_calibration(std::string_view text, std::string file_name);

}  // namespace redag
