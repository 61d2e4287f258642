// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rules that a workload must keep, each stated once: for workloads built in C++ and, through workload_yaml.hpp, for
// files. Rules about text (units, unknown keys, unresolved names) belong to the reader. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/result.hpp"
#include "redag/model/valid_workload.hpp"
#include "redag/model/workload.hpp"

namespace redag {

inline constexpr std::uint32_t kMaxWorkers = 4096;
inline constexpr std::uint32_t kMaxQueueDepth = 65536;
inline constexpr std::uint32_t kMaxConcurrency = 1024;
inline constexpr std::uint32_t kMaxDegrade = 1'000'000;  // releases skipped, or periods stretched
inline constexpr std::uint32_t kMaxBound = 1'000'000;    // max_active, max_pending
inline constexpr std::size_t kMaxNameBytes = 1000;
inline constexpr std::size_t kMaxClusters = 64;
inline constexpr std::size_t kMaxDevices = 64;
inline constexpr std::uint32_t kMaxSlots = 4096;
inline constexpr std::size_t kMaxWaits = 64;  // of one task

/// Says why `name` cannot stand in one-line messages and tables: "is empty", "contains U+001B, ...". Empty if it can.
[[nodiscard]] std::string name_mistake(std::string_view name);

/// The first reason why a platform cannot have these devices; empty if it can.
[[nodiscard]] std::string device_mistake(const std::vector<Device> &devices);

/// The parts of a workload; fields.hpp says what each may be. to_string() gives the key of the file format.
enum class Field : std::uint8_t {
  Name,
  Platform,
  Workers,
  Preemption,
  Policy,
  Ties,
  Dags,
  Tasks,
  MaxActive,
  MaxPending,
  Criticality,
  Degrade,
  Edges,
  Wcet,
  WcetLow,
  Bcet,
  Period,
  Deadline,
  Offset,
  Jitter,
  Region,
  Budget,
  OnBudget,
  Activation,
  Overrun,
  Priority,
  Concurrency,
  Group,
  After,
  Execution,
  Callback,
  Clusters,
  Cluster,
  Cpus,
  Segments,
  Devices,
  Slots,
  Queue,
  Rate,  // in place of Period; find_mistakes() knows periods only
};

inline constexpr std::size_t kFieldCount = static_cast<std::size_t>(Field::Rate) + 1;

[[nodiscard]] const char *to_string(Field field);

/// A set of fields, one bit each.
class FieldSet {
 public:
  constexpr FieldSet() = default;
  constexpr FieldSet(Field field) : bits_(std::uint64_t{1} << static_cast<unsigned>(field)) {}

  [[nodiscard]] constexpr bool intersects(FieldSet other) const { return (bits_ & other.bits_) != 0; }
  constexpr FieldSet &operator|=(FieldSet other) {
    bits_ |= other.bits_;
    return *this;
  }
  friend constexpr FieldSet operator|(FieldSet a, FieldSet b) { return a |= b; }

 private:
  std::uint64_t bits_ = 0;
};

[[nodiscard]] constexpr FieldSet operator|(Field a, Field b) { return FieldSet(a) | FieldSet(b); }

/// Parts of a callback, for Finding::item.
inline constexpr std::uint32_t kCallbackNode = 0;
inline constexpr std::uint32_t kCallbackKind = 1;  // with its name, period or index

/// One broken rule and the place in the workload to change.
struct Finding {
  static constexpr std::uint32_t kNone = UINT32_MAX;

  Severity severity = Severity::Error;
  DagId dag;                   // invalid: about the workload
  std::uint32_t task = kNone;  // index in the DAG; kNone: about the DAG
  Field field = Field::Name;   // the field to point at
  // Index in `predecessors`, `samples`, `clusters`, `devices` or `waits`, or part of the callback.
  std::uint32_t item = kNone;
  FieldSet involves;  // all fields that the rule examined
  std::string message;
  std::string hint;
};

struct ValidateOptions {
  /// Allows a task with a callback to have no wcet (0), because it is yet to be measured.
  bool wcet_optional = false;
  /// Allows tasks to wait without a worker. What does not know waits must not get such a workload.
  bool waits = false;
  /// Workers of a file that states none.
  std::uint32_t default_workers = 1;
  /// A task with `after`, but without `activation`, is a timer task, as in what earlier versions wrote.
  bool timers_by_default = false;
};

/// Returns every broken rule, in the order of the workload. Linear in its size. Accepts any workload without a crash.
[[nodiscard]] std::vector<Finding> find_mistakes(const Workload &workload, ValidateOptions options = {});

/// Returns find_mistakes() as messages without a place, errors and warnings; empty for a flawless workload.
[[nodiscard]] Diagnostics validate(const Workload &workload, ValidateOptions options = {});

[[nodiscard]] bool has_errors(const Diagnostics &diagnostics);

/// Returns the workload for an executor. Tasks with callbacks need no wcet. Error: all findings, if one of them is an
/// error.
[[nodiscard]] Result<ValidWorkload> validated(Workload workload);

}  // namespace redag
