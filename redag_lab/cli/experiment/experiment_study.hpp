// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The interface of `redag experiment` to every kind of experiment: numbered units with results of one line each. A
// study belongs to one command. Several threads call evaluate(), unless takes_turns().
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

  /// The subcommand that runs the study, and the plural noun for its units, such as "workloads".
  [[nodiscard]] virtual const char *command() const = 0;
  [[nodiscard]] virtual const char *units_are() const = 0;
  /// Returns the canonical text of the plan.
  [[nodiscard]] virtual std::string plan() const = 0;
  [[nodiscard]] virtual std::uint64_t unit_count() const = 0;
  /// True if units run one at a time on an otherwise idle machine, because other load affects their results.
  [[nodiscard]] virtual bool takes_turns() const { return false; }
  /// Orders the units still to do, which are given by number.
  virtual void arrange(std::vector<std::uint64_t> & /*units*/) const {}

  /// Returns the unit's result.
  [[nodiscard]] virtual Result<std::string> evaluate(std::uint64_t unit) const = 0;
  /// Counts a result. Error: a unit or a result that the plan does not have.
  [[nodiscard]] virtual Result<void> add(std::uint64_t unit, const std::string &result) = 0;
  [[nodiscard]] virtual std::uint64_t done() const = 0;

  /// Presents the results so far: as files, as a JSON document (`runs`: redag_lab/experiment/folder.hpp), in words.
  [[nodiscard]] virtual Result<void> write(const std::string &folder) const = 0;
  [[nodiscard]] virtual std::string json(const std::vector<std::string> &runs) const = 0;
  [[nodiscard]] virtual std::string describe(const StreamTraits &traits) const = 0;
  /// Lists the files in the folder, one per line, for "Open these files".
  [[nodiscard]] virtual std::string files(const std::string &folder) const = 0;
  /// Prints violations and other failures, and returns the exit status. `folder` is empty if nothing was written.
  [[nodiscard]] virtual int judge(const std::string &folder, Console &console) const = 0;
};

}  // namespace redag::cli
