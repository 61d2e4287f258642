// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a schedulability analysis is and what it answers. A method is a pure function of a System; it answers with a
// bound or says why it does not apply, and it says no when in doubt. Response times run from the nominal release.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "redag_analysis/core/system.hpp"

namespace redag::analysis {

/// One share of a response time, so that a user sees what to change.
struct Term {
  enum class Kind : std::uint8_t {
    Own,       // the task's, or its unit's, own execution
    Earlier,   // earlier jobs of the same task in the busy period, less the time since they were released (<= 0 too)
    Blocking,  // by less urgent work that cannot be preempted, or that holds the group
    Interference,  // by more urgent work
    Jitter,        // the release seen late
    Wait,          // for data of predecessors of other rates; of a DAG, also the age of that data
    Overhead,      // the platform's, for this job; overheads of others are part of their terms
    Waiting,       // for workers, predecessors and releases together, where nobody's share can be told
  };
  Kind kind = Kind::Own;
  TaskId task;  // whose; neither: nobody in particular
  DagId dag;    // whose, where a unit of several tasks is meant
  Duration amount = 0;
  std::int64_t jobs = 0;  // how many jobs it stands for, 0 where that has no meaning

  friend bool operator==(const Term &, const Term &) = default;
};

/// Bound on the response time of every job of a task, or of every instance of a DAG. Invariant: with a response, the
/// terms add up to it; there are none where it was not to be itemised (effort.hpp).
struct ResponseBound {
  std::optional<Duration> response;  // nothing: no bound, see `absent`
  std::string_view absent;           // why there is none: a sentence without a period
  std::vector<Term> terms;
  /// From readiness (the release as seen) to the finish, where a method finds that to be more than `response` less
  /// jitter.
  Duration from_ready = 0;

  [[nodiscard]] Duration sum(Term::Kind kind) const;
};

struct NotApplicable {
  std::string reason;
  bool gave_up = false;  // it would apply, and was ended at a limit or by the caller
};

/// What a task answers within in each mode (amc_rtb); nothing: no bound, or none is given in that mode.
struct ModeResponses {
  std::optional<Duration> low;     // a job that ends in LO mode
  std::optional<Duration> high;    // one that is released in HI mode
  std::optional<Duration> change;  // one that sees HI mode begin
};

struct Bound {
  std::vector<ResponseBound> tasks;  // by TaskId; empty: the method bounds no response times
  std::vector<ResponseBound> dags;   // by DagId, from the source's release to the finish of the last task; or empty
  std::vector<ModeResponses> modes;  // by TaskId, of methods that know modes
  /// Tests that answer yes or no for all tasks together. True: every deadline is met. False: nothing is known.
  std::optional<bool> accepts;
  /// What the test compared, for people: "U = 0.812, limit 0.780".
  std::string figures;
  /// Why these numbers must not be trusted here (only of methods labelled `paper`); empty: the bound is sound.
  std::string unsound;
};

using Outcome = std::variant<NotApplicable, Bound>;

enum class Subject : std::uint8_t { Task, Dag, System };

[[nodiscard]] const char *to_string(Subject subject);
[[nodiscard]] const char *to_string(Term::Kind kind);

struct Method {
  std::string_view name{};  // as in "--method rta_preemptive"
  Subject subject = Subject::Task;
  std::string_view cite{};         // authors, title, where, year
  std::string_view assumptions{};  // when it applies, in words
  std::string_view complexity{};
  std::string_view sound_only_if{};  // of the paper's own equations; empty: sound wherever it applies
  bool quick = false;                // about linear in the tasks: worth asking first
  bool knows_modes = false;          // applies where there is a HI mode (System::has_modes)
  std::function<Outcome(const System &system)> apply{};

  [[nodiscard]] bool is_paper() const { return !sound_only_if.empty(); }
};

enum class Verdict : std::uint8_t { Schedulable, NotShown };

[[nodiscard]] const char *to_string(Verdict verdict);

/// A job of the task meets its deadline and none is skipped.
[[nodiscard]] bool meets_deadline(const SystemTask &task, const ResponseBound &bound);
/// Schedulable where the bound covers every task (and every DAG with a deadline) and each is met, or the test accepts.
/// Says nothing of `unsound`.
[[nodiscard]] Verdict verdict(const System &system, const Bound &bound);

/// The bound, or none where its response is kUnbounded.
[[nodiscard]] ResponseBound if_bounded(ResponseBound bound);

/// Responses of units (by unit) as those of their tasks and DAGs: a task answers no later than its unit, a DAG with
/// its last unit.
[[nodiscard]] Bound from_units(const System &system, std::vector<ResponseBound> units);

/// Every method known, in the order in which a report shows them. Adding one: a file pair and a line in methods.cpp.
[[nodiscard]] const std::vector<Method> &methods();
/// Of methods(); null for an unknown name.
[[nodiscard]] const Method *find_method(std::string_view name);

}  // namespace redag::analysis
