// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The interface of the schedulability methods. A method is a pure function of a TaskSet. It answers with a bound or
// says why it does not apply; in doubt it says no. Response times run from the nominal release.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis {

/// One part of a response time. The terms show a user what to change.
struct Term {
  enum class Kind : std::uint8_t {
    Own,           // own execution of the task or of its unit
    Earlier,       // earlier jobs of the task in the busy period, less the time since their release; can be <= 0
    Blocking,      // less urgent work that cannot be preempted, or that holds the group
    Interference,  // more urgent work
    Jitter,        // the time by which the release is seen late
    Wait,          // waiting for data of predecessors of other rates; for a DAG, also the age of that data
    Suspended,     // waits of the task or its unit without a worker, without the time in queues of devices
    Overhead,      // the platform's overhead for this job; the terms of others include their own
  };
  Kind kind = Kind::Own;
  TaskId task;  // the task that causes it; neither `task` nor `dag`: no single cause
  DagId dag;    // the DAG that causes it, where a unit of several tasks does
  Duration amount = 0;
  std::int64_t jobs = 0;  // number of jobs that it stands for; 0 where a number has no meaning
  DeviceId device{};      // the device whose service or queue it is; none: the workers, or no resource at all

  friend bool operator==(const Term &, const Term &) = default;
};

/// A bound on the response time of every job of a task, or of every instance of a DAG. If there is a response, the
/// terms add up to it; there are no terms if the caller did not ask to itemise this bound (effort.hpp).
struct ResponseBound {
  std::optional<Duration> response;  // empty: no bound, see `absent`
  std::string_view absent;           // why there is no bound: a sentence without a period
  std::vector<Term> terms;
  /// The bound is that of jobs that end: others can be skipped or cut off, whatever their deadline.
  bool of_ended = false;
  /// The longest time from readiness (the release as seen) to the finish. Only a method that finds more than `response`
  /// less jitter sets it.
  Duration from_ready = 0;
  /// What the task adds to reaction and age of a chain whose data it takes or begins. Only across_rates() sets it, for
  /// tasks of DAGs with edges between rates; of others it is period + response.
  std::optional<Duration> hop;

  [[nodiscard]] Duration sum(Term::Kind kind) const;
};

struct NotApplicable {
  std::string reason;
  bool gave_up = false;  // the method applies, but a limit or the caller ended it
};

/// The response times of a task in each mode (amc_rtb). An empty value means that there is no bound, or none for that
/// mode.
struct ModeResponses {
  std::optional<Duration> low;     // of jobs that end in LO mode
  std::optional<Duration> high;    // of jobs that are released in HI mode
  std::optional<Duration> change;  // of jobs during which HI mode begins
};

struct Bound {
  std::vector<ResponseBound> tasks;  // by TaskId; empty if the method bounds no response times
  std::vector<ResponseBound> dags;   // by DagId, from the source's release to the finish of the last task; or empty
  std::vector<ModeResponses> modes;  // by TaskId; only from methods that know modes
  /// The answer of a test for all tasks together. True: every deadline is met. False: the test shows nothing.
  std::optional<bool> accepts;
  /// What the test compared, as text for a reader: "U = 0.812, limit 0.780".
  std::string figures;
  /// Why these numbers must not be trusted here. Only methods labelled `paper` set it; empty: the bound is sound.
  std::string unsound;
};

using Outcome = std::variant<NotApplicable, Bound>;

enum class Subject : std::uint8_t { Task, Dag, TaskSet };

[[nodiscard]] const char *to_string(Subject subject);
[[nodiscard]] const char *to_string(Term::Kind kind);

struct Method {
  std::string_view name{};  // as in "--method rta_preemptive"
  Subject subject = Subject::Task;
  std::string_view cite{};         // authors, title, place of publication, year
  std::string_view assumptions{};  // when the method applies, in words
  std::string_view complexity{};
  std::string_view sound_only_if{};  // what the paper's own equations need to be sound; empty: nothing more
  bool knows_modes = false;          // it applies where there is a HI mode (TaskSet::has_modes)
  bool knows_waits = false;          // it covers tasks that wait (TaskSet::has_waits)
  bool knows_all = false;            // it covers all features, and is applied where other methods leave tasks unbounded
  std::function<Outcome(const TaskSet &task_set)> apply{};

  [[nodiscard]] bool is_paper() const { return !sound_only_if.empty(); }
};

enum class Verdict : std::uint8_t { Schedulable, NotShown };

/// True if every job of the task meets its deadline and none is skipped.
[[nodiscard]] bool meets_deadline(const CompiledTask &task, const ResponseBound &bound);
/// Schedulable if the test accepts, or if the bound covers every task and every DAG with a deadline and each deadline
/// is met. The verdict ignores `unsound`.
[[nodiscard]] Verdict verdict(const TaskSet &task_set, const Bound &bound);

/// Returns the bound, or one without a response if its response is kUnbounded.
[[nodiscard]] ResponseBound if_bounded(ResponseBound bound);

/// Turns the responses of units (by unit) into those of their tasks and DAGs. A task answers no later than its unit,
/// and a DAG with its last unit.
[[nodiscard]] Bound from_units(const TaskSet &task_set, std::vector<ResponseBound> units);

/// from_tasks() gives each DAG the bound of its task that ends last. If some task has no bound, neither has the DAG.
[[nodiscard]] Bound from_tasks(const TaskSet &task_set, std::vector<ResponseBound> tasks);

/// Every method, in the order in which a report shows them. To add one, add a file pair and a line in methods.cpp.
[[nodiscard]] const std::vector<Method> &methods();

}  // namespace redag::analysis
