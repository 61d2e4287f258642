// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An executor as the command line names it: which scheduler, which preemption, which threads. "redag", "redag-none",
// "redag-cooperative", "redag-os"; the models of other executors, "mte", "ste", ..., and "mte-fifo", "ste-fifo", ...,
// the same on real-time threads. Pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::cli {

struct Variant {
  std::string name;                          // as it was written
  std::string executor;                      // of sched::executors()
  std::optional<PreemptionMode> preemption;  // instead of the workload's; peers: none
  bool realtime_threads = false;

  [[nodiscard]] bool is_redag() const { return executor == "redag"; }
};

[[nodiscard]] const std::vector<std::string> &variant_names();

/// Error: an unknown name, with the nearest one.
[[nodiscard]] Result<Variant> parse_variant(const std::string &name);

/// The workload as the executor runs it: its own preemption mode and number of workers. Error: it cannot.
[[nodiscard]] Result<Workload> configure(const Workload &workload, const Variant &variant);

/// As workloads and the command line name it: full preemption is "os".
[[nodiscard]] const char *mode_name(sched::Preemption preemption);

/// "redag,mte": at least one, none twice.
[[nodiscard]] Result<std::vector<Variant>> parse_variants(std::string_view list);

}  // namespace redag::cli
