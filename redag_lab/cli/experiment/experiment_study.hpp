// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An experiment as `redag experiment` sees it, whatever it measures: numbered units with results of one line each. One
// study belongs to one command; evaluate() is called from several threads unless the study takes turns.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

class Study {
 public:
  Study() = default;
  Study(const Study &) = delete;
  Study &operator=(const Study &) = delete;
  virtual ~Study() = default;

  /// The subcommand that runs it, and what a unit is: "workloads".
  [[nodiscard]] virtual const char *command() const = 0;
  [[nodiscard]] virtual const char *units_are() const = 0;
  /// Canonical text.
  [[nodiscard]] virtual std::string plan() const = 0;
  [[nodiscard]] virtual std::uint64_t unit_count() const = 0;
  /// One unit at a time, and nothing else beside it: its result depends on how busy the machine is.
  [[nodiscard]] virtual bool takes_turns() const { return false; }
  /// The order in which units that are still to do are done; they come by number.
  virtual void arrange(std::vector<std::uint64_t> & /*units*/) const {}

  /// The unit's result.
  [[nodiscard]] virtual Result<std::string> evaluate(std::uint64_t unit) const = 0;
  /// Counts a result. Error: a unit or a result that the plan does not have.
  [[nodiscard]] virtual Result<void> add(std::uint64_t unit, const std::string &result) = 0;
  [[nodiscard]] virtual std::uint64_t done() const = 0;

  /// The results so far: files, a JSON document (`runs`: redag_lab/experiment/folder.hpp), words.
  [[nodiscard]] virtual Result<void> write(const std::string &folder) const = 0;
  [[nodiscard]] virtual std::string json(const std::vector<std::string> &runs) const = 0;
  [[nodiscard]] virtual std::string describe(const StreamTraits &traits) const = 0;
  /// What lies in the folder, a line each, for "Open these files".
  [[nodiscard]] virtual std::string files(const std::string &folder) const = 0;
  /// Says what must not be overlooked, if anything; the exit status. `folder` is empty where nothing was written.
  [[nodiscard]] virtual int judge(const std::string &folder, Console &console) const = 0;
};

}  // namespace redag::cli
