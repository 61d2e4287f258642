// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The processes of an MPI run. Rank 0 hands out units, does some itself, and receives the results; the others evaluate.
// A rank that is killed costs nothing but time where the launcher lets the others live (Open MPI: --enable-recovery).
// One object for a process; used by its main thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/runner.hpp"

namespace redag::experiment {

/// What rank 0 knows at the end.
struct LeadReport {
  std::uint64_t repeated = 0;  // units that were handed out again, because their rank had not finished them
  std::uint32_t silent = 0;    // ranks that do not answer: killed, most probably
};

class Ranks {
 public:
  virtual ~Ranks() = default;
  Ranks(const Ranks &) = delete;
  Ranks &operator=(const Ranks &) = delete;

  /// Joins the processes that the launcher started. Error: this build has no MPI, or MPI does not start.
  [[nodiscard]] static Result<std::unique_ptr<Ranks>> join();

  [[nodiscard]] virtual std::uint32_t rank() const = 0;
  [[nodiscard]] virtual std::uint32_t size() const = 0;

  /// Rank 0: returns once all `count` units of `next` are accepted, or the run was stopped. `accept` is called on this
  /// thread, in no order. `subject` identifies the plan and the version, the same on all ranks.
  /// Error: the first one of a rank.
  [[nodiscard]] virtual Result<LeadReport> lead(const std::string &subject, const NextUnit &next, std::uint64_t count,
                                                const RunnerOptions &options, const Evaluate &evaluate,
                                                const Accept &accept) = 0;
  /// Other ranks: evaluates until rank 0 says that all is done; no more units once stopped. Rank 0 learns of units that
  /// cannot be evaluated. Error: rank 0 is lost.
  [[nodiscard]] virtual Result<void> follow(const std::string &subject, const RunnerOptions &options,
                                            const Evaluate &evaluate) = 0;
  /// Leaves the run and ends the process: an orderly end of MPI waits for all ranks, and some may be lost.
  virtual void leave(int status) = 0;

 protected:
  Ranks() = default;
};

}  // namespace redag::experiment
