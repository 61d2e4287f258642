// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The fields of workload files, a row for each: its key, its member, its range, and what the page says about it. Made
// from the rows are the reader, the checks of single numbers, the writer, the hints of keys, and the tables of
// docs/workload_format.md and docs/workload.schema.json. A new field is a member of the model, a Field, and a row.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/validate.hpp"
#include "redag/model/workload.hpp"

namespace redag::fields {

/// What a member may be.
struct Rule {
  std::int64_t least = 1;  // of a number that a file states; the default of the member is always allowed
  std::int64_t most = kMaxDuration;
  bool is_joint = false;   // not read and written by its type alone: other fields matter, or other forms are allowed
  bool is_needed = false;  // the default of the member is no value: the reader gives it another one
  bool is_stated = false;  // is written even if it has its default
};

/// `Member` is a pointer to a member, or nullptr_t for a field that is several members, or a part of the file.
template <class Member>
struct Row {
  Field field;
  const char *key;
  Member member;
  const char *absent;  // what a file without it means, or "required"; null: the default of the member
  const char *text;
  Rule rule;
};

template <class Member>
constexpr Row<Member> row(Field field, const char *key, Member member, const char *absent, const char *text,
                          Rule rule = {}) {
  return {field, key, member, absent, text, rule};
}

inline constexpr std::tuple kWorkload = {
    row(Field::Name, "name", &Workload::name, "the name of the file, without `.yaml`", "name in results"),
    row(Field::Platform, "platform", nullptr, "one worker", "what executes the jobs"),
    row(Field::Policy, "policy", &Workload::policy, nullptr, "the order of jobs", {.is_stated = true}),
    row(Field::Ties, "ties", &Workload::ties, nullptr,
        "`share`: tasks of equal priority take turns, the oldest data first; `fixed`: always in the order of tasks "
        "([model.md](model.md), \"Ties\")"),
    row(Field::Dags, "dags", nullptr, "required", "list of DAGs, at least one"),
};

inline constexpr std::tuple kPlatform = {
    row(Field::Workers, "workers", &Platform::workers, "one for each of the `cpus`, or 1",
        "jobs that execute at the same time", {.most = kMaxWorkers, .is_joint = true, .is_stated = true}),
    row(Field::Cpus, "cpus", &Platform::cpus, "any", "processors of the workers; not with clusters",
        {.is_joint = true}),
    row(Field::Preemption, "preemption", &Platform::preemption, nullptr, "what can interrupt a running job",
        {.is_stated = true}),
    row(Field::Clusters, "clusters", nullptr, "none",
        "list of [clusters](#a-cluster), 1 to 64, in place of `platform.workers`"),
    row(Field::Devices, "devices", &Platform::devices, "none",
        "map of names to [devices](#devices-and-segments), at most 64; clusters share them"),
};

inline constexpr std::tuple kCluster = {
    row(Field::Name, "name", &Cluster::name, "required", "unique in the file"),
    row(Field::Workers, "workers", &Cluster::workers, "one for each of the `cpus`, or 1",
        "jobs of the cluster that execute at the same time (4096 in all clusters)",
        {.most = kMaxWorkers, .is_joint = true, .is_stated = true}),
    row(Field::Cpus, "cpus", &Cluster::cpus, "any", "processors of its workers; clusters share none",
        {.is_joint = true}),
};

inline constexpr std::tuple kDevice = {
    row(Field::Slots, "slots", &Device::slots, nullptr, "jobs that it serves at the same time",
        {.most = kMaxSlots, .is_stated = true}),
    row(Field::Queue, "queue", &Device::queue, nullptr,
        "`priority`: the first in the order of jobs comes next; `fifo`: the one that asked first; clusters need it",
        {.is_stated = true}),
};

inline constexpr std::tuple kDag = {
    row(Field::Name, "name", &Dag::name, "required", "unique in the file"),
    row(Field::Cluster, "cluster", &Dag::cluster, "the only one; required if there are several",
        "name of the cluster that serves it"),
    row(Field::Period, "period", nullptr, "none", "default of the period of its timer tasks"),
    row(Field::Rate, "rate", nullptr, "none", "in place of `period`"),
    row(Field::Deadline, "deadline", &Dag::deadline, "none",
        "end to end, from a source's release to a sink's finish; tasks have their own"),
    row(Field::MaxActive, "max_active", &Dag::max_active, "no bound", "jobs started and not finished at any time",
        {.most = kMaxBound}),
    row(Field::MaxPending, "max_pending", &Dag::max_pending, "no bound", "jobs released and not started at any time",
        {.most = kMaxBound}),
    row(Field::Criticality, "criticality", &Dag::criticality, nullptr, "of the DAG and all its tasks"),
    row(Field::Degrade, "degrade", &Dag::degrade, "`stop`",
        "in HI mode: `stop`, `{skip: N}` (periods skipped after each admitted one) or `{stretch: FACTOR}` (of its "
        "periods, from 1); not with criticality `high`"),
    row(Field::Edges, "edges", &Dag::edges, nullptr,
        "under ROS 2: `executed`, a callback waits for its message and its predecessors; `seen` (in learned files), "
        "for "
        "its message only"),
    row(Field::Tasks, "tasks", nullptr, "required", "list of tasks, at least one"),
};

inline constexpr std::tuple kTask = {
    row(Field::Name, "name", &Task::name, "required", "unique in the DAG"),
    row(Field::Wcet, "wcet", &Task::wcet, "required without `segments`; with `callback`, see below",
        "longest execution time (processor time)", {.is_joint = true, .is_needed = true}),
    row(Field::Bcet, "bcet", &Task::bcet, "unknown (0)", "shortest execution time, at most `wcet`", {.least = 0}),
    row(Field::WcetLow, "wcet_low", &Task::wcet_low, "none",
        "C(LO), at most `wcet` = C(HI); a job that uses it begins HI mode; criticality `high` only"),
    row(Field::Segments, "segments", nullptr, "none",
        "in place of `wcet`: execution and waits in turn ([below](#devices-and-segments))"),
    row(Field::Execution, "execution", &Task::execution, "see below",
        "how long synthetic jobs execute ([below](#execution-times))"),
    row(Field::Activation, "activation", nullptr, "see below",
        "`timer`: released every `period`. `data`: released when every predecessor has completed once more. `event`: "
        "released from outside, at least a `period` apart"),
    row(Field::Period, "period", &Task::period, "that of its callback's timer, or else the DAG's", "of a timer task",
        {.is_joint = true, .is_needed = true}),
    row(Field::Rate, "rate", nullptr, "none", "in place of `period`"),
    row(Field::Deadline, "deadline", &Task::deadline, "the period", "relative to the release", {.is_needed = true}),
    row(Field::Offset, "offset", &Task::offset, "0",
        "first release of a timer task; `any`: nothing synchronises it with others", {.least = 0, .is_joint = true}),
    row(Field::Jitter, "jitter", &Task::jitter, "0",
        "longest delay with which a release of a timer task is seen; releases keep their order", {.least = 0}),
    row(Field::Region, "region", &Task::region, "the whole job",
        "longest stretch without a preemption point, for the cooperative mode"),
    row(Field::Budget, "budget", &Task::budget, "none", "processor time after which `on_budget` applies to a job"),
    row(Field::OnBudget, "on_budget", &Task::on_budget, nullptr,
        "`abort`: cut off; `log`: noted; `demote`: continues below all other jobs; `skip_next`: skips the task's next "
        "release"),
    row(Field::Criticality, "criticality", &Task::criticality, "the DAG's",
        "another value than the DAG's has no effect and causes a warning", {.is_joint = true}),
    row(Field::After, "after", nullptr, "none",
        "predecessors: names of tasks of the same DAG, a list or one name, in any order in the file"),
    row(Field::Concurrency, "concurrency", &Task::concurrency, nullptr,
        "jobs of the task in progress at once: a reentrant callback; in a `group` it is 1", {.most = kMaxConcurrency}),
    row(Field::Group, "group", &Task::group, "none",
        "jobs of one group never overlap; a list joins its groups into one; groups span no two clusters",
        {.is_joint = true}),
    row(Field::Overrun, "overrun", nullptr, "`skip`", "`skip`, `queue` (a queue of 1) or `{queue: N}`, N up to 65536"),
    row(Field::Priority, "priority", &Task::priority, "0", "for policy `fixed`, larger is more urgent",
        {.least = std::numeric_limits<int>::min(), .most = std::numeric_limits<int>::max()}),
    row(Field::Callback, "callback", &Task::callback, "none",
        "the ROS 2 callback of the task ([below](#ros-2-callbacks))"),
};

template <class Rows, class Visit>
constexpr void for_each(const Rows &rows, const Visit &visit) {
  std::apply([&](const auto &...row) { (visit(row), ...); }, rows);
}

template <class Member>
inline constexpr bool kHasMember = !std::is_same_v<Member, std::nullptr_t>;

/// The type of a value, also of one that may be absent.
template <class T>
struct ValueOf {
  using type = T;
};
template <class T>
struct ValueOf<std::optional<T>> {
  using type = T;
};

/// True for a pointer to a member that is a duration or a count.
template <class Member>
inline constexpr bool kHasNumber = false;
template <class Owner, class T>
inline constexpr bool kHasNumber<T Owner::*> = std::is_integral_v<T>;

/// Formats a value as a file states it.
inline std::string text_of(const std::string &text) { return text; }
inline std::string text_of(Duration value) { return format_duration(value); }
inline std::string text_of(std::uint32_t value) { return std::to_string(value); }
inline std::string text_of(const std::optional<int> &value) { return std::to_string(*value); }
inline std::string text_of(const std::vector<int> &cpus) { return format_cpu_list(cpus); }
template <class Enum>
requires std::is_enum_v<Enum> std::string text_of(Enum value) { return to_string(value); }

/// Returns all fields of a table.
template <class Rows>
constexpr FieldSet all_of(const Rows &rows) {
  FieldSet all;
  for_each(rows, [&](const auto &row) { all |= row.field; });
  return all;
}

/// Returns the keys of a table, in its order.
template <const auto &rows>
const std::vector<std::string_view> &keys_of() {
  static const std::vector<std::string_view> kKeys = [] {
    std::vector<std::string_view> all;
    for_each(rows, [&](const auto &row) { all.emplace_back(row.key); });
    return all;
  }();
  return kKeys;
}

}  // namespace redag::fields
