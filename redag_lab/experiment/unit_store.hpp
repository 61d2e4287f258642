// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// units.db: the finished units of an experiment, a SQLite database in which a killed run can continue. Units reach the
// kernel within kWriteEvery and the disk within kSyncEvery, and are read one by one in bounded memory. One process at a
// time uses the file, from whichever machine; not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/finished_unit.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace redag::experiment {

/// Reads the units of a store in their order. The store must outlive it.
class UnitCursor {
 public:
  /// Moves to the next unit. Returns false at the end. Error: the file is damaged.
  [[nodiscard]] Result<bool> next();
  [[nodiscard]] const FinishedUnit &unit() const { return unit_; }

 private:
  friend class UnitStore;
  struct Finalize {
    void operator()(sqlite3_stmt *statement) const;
  };

  std::string path_;
  std::unique_ptr<sqlite3_stmt, Finalize> rows_;
  FinishedUnit unit_;
};

class UnitStore {
 public:
  static constexpr std::chrono::milliseconds kWriteEvery{200};
  static constexpr std::chrono::seconds kSyncEvery{2};

  /// Opens or creates the file. `subject` identifies the origin of the results; a file of another subject is refused.
  /// Errors: the file cannot be used, another process uses it, or it is no database of units.
  [[nodiscard]] static Result<UnitStore> open(const std::string &path, std::string_view subject);
  /// Opens an existing file for reading, for merging. It changes only what a killed run left unfinished.
  [[nodiscard]] static Result<UnitStore> read(const std::string &path, std::string_view subject);

  UnitStore(UnitStore &&other) noexcept;
  UnitStore &operator=(UnitStore &&) = delete;
  UnitStore(const UnitStore &) = delete;
  UnitStore &operator=(const UnitStore &) = delete;
  /// Writes the remaining units. To detect a failure, call sync() first.
  ~UnitStore();

  [[nodiscard]] Result<UnitCursor> units() const;

  /// Adds a result, in any order. The same result of a unit counts once. Errors: another result of this unit, or the
  /// file cannot be written; nothing more is written then.
  [[nodiscard]] Result<void> append(std::uint64_t unit, const std::string &result);
  /// Writes all units to the disk.
  [[nodiscard]] Result<void> sync();

 private:
  using Clock = std::chrono::steady_clock;
  struct Close {
    void operator()(sqlite3 *database) const;
  };
  using Statement = std::unique_ptr<sqlite3_stmt, UnitCursor::Finalize>;

  explicit UnitStore(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] Result<void> connect(bool create);
  [[nodiscard]] Result<void> create(std::string_view subject);
  [[nodiscard]] Result<void> check(std::string_view subject);
  [[nodiscard]] Result<void> execute(const char *statement, const char *what);
  [[nodiscard]] Result<Statement> prepare(const char *text) const;
  [[nodiscard]] Result<void> compare(std::uint64_t unit, const std::string &result);
  [[nodiscard]] Result<void> commit();

  std::string path_;
  std::unique_ptr<sqlite3, Close> database_;
  Statement insert_;
  bool open_transaction_ = false;
  bool broken_ = false;
  Clock::time_point last_write_ = Clock::now();
  Clock::time_point last_sync_ = last_write_;
};

/// The error for a unit that has two results.
[[nodiscard]] tl::unexpected<Diagnostics> two_results(const std::string &file, std::uint64_t unit,
                                                      std::string_view first, std::string_view second);

}  // namespace redag::experiment
