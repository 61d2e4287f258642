// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// units.csv: the finished units of an experiment, one per line. The file is only appended to, and a killed run can
// continue from it. Lines reach the kernel within kWriteEvery and the disk within kSyncEvery. One process at a time
// uses the file (flock); not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"

namespace redag::experiment {

struct FinishedUnit {
  std::uint64_t unit = 0;
  std::string result;  // the experiment's result text, without line breaks

  friend bool operator==(const FinishedUnit &, const FinishedUnit &) = default;
};

class Journal {
 public:
  static constexpr std::chrono::milliseconds kWriteEvery{200};
  static constexpr std::chrono::seconds kSyncEvery{2};

  /// Opens or creates the file. `subject` (one line) identifies the origin of the results; a file of another subject is
  /// refused. A last line without its end (the process was killed) is cut off. A unit that occurs twice with the same
  /// result counts once. Errors: the file cannot be used, another process uses it, a malformed line, or a unit with two
  /// results.
  [[nodiscard]] static Result<Journal> open(std::string path, std::string_view subject);

  Journal(Journal &&other) noexcept;
  Journal &operator=(Journal &&) = delete;
  Journal(const Journal &) = delete;
  Journal &operator=(const Journal &) = delete;
  /// Writes the remaining lines. To detect a failure, call sync() first.
  ~Journal();

  /// The units in the file when it was opened, by unit.
  [[nodiscard]] const std::vector<FinishedUnit> &found() const { return found_; }

  /// Appends a result, which must be one line. After an error nothing more is written.
  [[nodiscard]] Result<void> append(std::uint64_t unit, std::string_view result);
  /// Writes all lines to the disk.
  [[nodiscard]] Result<void> sync();

 private:
  using Clock = std::chrono::steady_clock;

  Journal(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
  [[nodiscard]] Result<void> begin(std::string_view subject);
  [[nodiscard]] Result<void> write();
  [[nodiscard]] tl::unexpected<Diagnostics> failure(std::string_view what) const;

  std::string path_;
  int descriptor_ = -1;
  bool broken_ = false;
  std::string buffer_;
  Clock::time_point last_write_ = Clock::now();
  Clock::time_point last_sync_ = last_write_;
  std::vector<FinishedUnit> found_;
};

/// Reads what open() would find without changing the file, for merging.
[[nodiscard]] Result<std::vector<FinishedUnit>> read_journal(const std::string &path, std::string_view subject);

/// Sorts by unit and keeps one of equal entries. Error: a unit with two results.
[[nodiscard]] Result<void> sort_and_unite(std::vector<FinishedUnit> &units, const std::string &file);

}  // namespace redag::experiment
