// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs the units of an experiment on several processors (oneTBB), and keeps the finished ones in a folder that several
// processes can share: a killed run goes on there. A process appends a row for each unit to a file of its own, with a
// checksum. It reads the rows of all.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag::experiment {

/// Returns a hash of the text (FNV-1a).
[[nodiscard]] std::uint64_t checksum(std::string_view text);

using Accept = std::function<Result<void>(std::uint64_t unit, const std::string &result)>;

/// Not thread-safe.
class UnitStore {
 public:
  /// Opens units.csv, and gives its units to `accept`; a unit can come twice. Leaves out damaged rows: those units are
  /// run again. `subject` is one line that names the plan and the version. Errors: a file of another subject, a file
  /// that cannot be used or that another process writes, and those of `accept`.
  [[nodiscard]] static Result<UnitStore> open(const std::string &folder, const std::string &subject,
                                              const Accept &accept);

  UnitStore(UnitStore &&other) noexcept;
  UnitStore &operator=(UnitStore &&) = delete;
  UnitStore(const UnitStore &) = delete;
  UnitStore &operator=(const UnitStore &) = delete;
  ~UnitStore();

  /// Appends a row, which outlives this process; it outlives the machine within two seconds. `result` is one line.
  [[nodiscard]] Result<void> append(std::uint64_t unit, const std::string &result);
  /// Writes all rows to the disk.
  [[nodiscard]] Result<void> sync();

 private:
  UnitStore(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
  [[nodiscard]] Result<void> write(std::string_view text);

  std::string path_;
  int descriptor_ = -1;
  Time last_sync_ = 0;
};

/// Returns a unit's result, one line of text. Several threads call it at once.
using Evaluate = std::function<Result<std::string>(std::uint64_t unit)>;

/// Evaluates the units, `jobs` at the same time, and calls `accept` one at a time, in any order. Once `stop` is true,
/// leaves out the units that have not begun. Error: the first one of `evaluate` or `accept`; no unit is begun after it.
[[nodiscard]] Result<void> run_units(const std::vector<std::uint64_t> &units, std::uint32_t jobs,
                                     const std::atomic<bool> &stop, const Evaluate &evaluate, const Accept &accept);

}  // namespace redag::experiment
