// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An executor by its name on the command line: scheduler, preemption and threads. Names are "redag", "redag-none",
// "redag-cooperative", "redag-os"; the models of other executors, "mte", "ste", ...; and "mte-fifo", "ste-fifo", ...,
// the same on real-time threads. Pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::lab {

struct Variant {
  std::string name;                          // as given
  std::string executor;                      // a name of executors::all()
  std::optional<PreemptionMode> preemption;  // replaces the workload's; other executors: none
  bool realtime_threads = false;

  [[nodiscard]] bool is_redag() const { return executor == "redag"; }
};

[[nodiscard]] const std::vector<std::string> &variant_names();

/// Parses a name. Error: an unknown name, with the nearest one.
[[nodiscard]] Result<Variant> parse_variant(const std::string &name);

/// Returns the workload as the executor runs it, with the executor's preemption mode and number of workers. Error: the
/// executor cannot run it.
[[nodiscard]] Result<Workload> configure(const Workload &workload, const Variant &variant);

/// Parses a list such as "redag,mte" with at least one name and none twice.
[[nodiscard]] Result<std::vector<Variant>> parse_variants(std::string_view list);

}  // namespace redag::lab
