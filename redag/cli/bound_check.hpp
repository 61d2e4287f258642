// A run on threads against what was proven before it: responses above their bounds, executions above the wcet, by name.
// Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/cli/console.hpp"
#include "redag/cli/json.hpp"
#include "redag/cli/session.hpp"

namespace redag::cli {

struct BoundCheck {
  /// One a task with a bound, or whose execution was too long.
  struct Row {
    std::string name;
    Duration bound = 0;  // 0: none
    std::string method;  // that gave it
    std::uint64_t exceeded = 0;
    Duration worst = 0;  // longest response above the bound
    Duration wcet = 0;
    Duration on_worker = 0;  // longest time that a job held its worker, where that is above the wcet; or 0

    [[nodiscard]] bool is_broken() const { return exceeded > 0 || on_worker > 0; }
  };
  std::vector<Row> rows;
  std::size_t bounded = 0;  // tasks
  std::string absent;       // why some task, or all, have no bound; empty: all have one
};

/// Analyses the workload as it ran, under the executor that ran it, without overheads. Responses are those of the whole
/// trace, warm-up included.
[[nodiscard]] BoundCheck check_bounds(const Session &session);

[[nodiscard]] std::string describe(const BoundCheck &check, std::size_t tasks, const StreamTraits &terminal);
[[nodiscard]] Json to_json(const BoundCheck &check);

}  // namespace redag::cli
