// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explains where the time of a job went, from its release to its end, or end to end: backwards along the data that it
// waited for. The parts of an explanation sum exactly to that time. A part has a cause only where the trace
// shows it; other time is called unknown. why_text.hpp has the words. Reads the run's
// events several times; memory grows with the jobs to explain, and not with the run. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/recording.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/metrics/why/why_cause.hpp"

namespace redag::metrics {

/// What to explain: a job, and from when on.
struct Subject {
  JobId job;
  bool end_to_end = false;  // from the release of the source whose data it carries; otherwise from its own release
};

struct Explanation {
  JobRecord job;
  Miss miss = Miss::None;
  bool end_to_end = false;
  Time begin = 0;           // r, or the origin
  Time end = 0;             // f; of a lost job when it was lost, of a job in flight the end of the run
  Duration deadline = 0;    // from `begin` on; 0: none, of a job without an end-to-end deadline
  std::vector<Part> parts;  // earliest first; their lengths sum to end - begin

  [[nodiscard]] Duration length() const { return end - begin; }
  /// Above 0: late. Requires a deadline.
  [[nodiscard]] Duration lateness() const { return length() - deadline; }
};

/// What one culprit cost the explained jobs.
struct Culprit {
  Cause cause = Cause::Unknown;
  TaskId task;           // invalid: no job caused it
  std::size_t jobs = 0;  // explained jobs that it delayed
  std::size_t main = 0;  // of these, jobs that it delayed most
  Duration time = 0;     // in all of them
  Duration longest = 0;  // in one of them
  TaskId delayed;        // the task of that one

  friend bool operator==(const Culprit &, const Culprit &) = default;
};

/// A row of a list of parts: one part, or consecutive ones together.
struct PartRow {
  std::span<const Part> parts;

  [[nodiscard]] Time begin() const { return parts.front().begin; }
  [[nodiscard]] Duration length() const;
  /// True if all of its parts are work.
  [[nodiscard]] bool is_work() const;
};

/// Returns a job's parts, earliest first, in at most `most` rows (at least 3). If there are more parts, the longest
/// ones have rows of their own, and those between them have one together. The rows refer to `parts`.
[[nodiscard]] std::vector<PartRow> rows_of(std::span<const Part> parts, std::size_t most);

class Investigation {
 public:
  /// Takes an explanation, and the index of its subject.
  using Visit = std::function<void(std::size_t, Explanation)>;

  /// Reads the run once. Keeps up to `most` of its misses, the worst ones. What `run` refers to must outlive the
  /// result. Error: a damaged file.
  [[nodiscard]] static Result<Investigation> of(const trace::Recording &run,
                                                std::size_t most = std::numeric_limits<std::size_t>::max());

  [[nodiscard]] const trace::RunInfo &run() const { return run_.info(); }
  /// The number of jobs that were not released during the warm-up; how many of them were late or lost, as
  /// JobCounts::missed(); and how many others missed only the end-to-end deadline of their DAG (Miss::EndToEnd).
  [[nodiscard]] std::uint64_t counted() const { return survey_.counted; }
  [[nodiscard]] std::uint64_t missed() const { return survey_.missed; }
  [[nodiscard]] std::uint64_t late_end_to_end() const { return survey_.late_end_to_end; }
  [[nodiscard]] std::uint64_t misses_in_all() const { return missed() + late_end_to_end(); }

  /// The jobs that missed a deadline: the latest first, relative to the deadline; then lost ones. Those released during
  /// the warm-up do not count. One that misses only its DAG's deadline is to be explained end to end.
  [[nodiscard]] const std::vector<Subject> &misses() const { return survey_.misses; }
  /// Of each task the finished job that came closest to its deadline or missed it most; at most `most`, the worst
  /// first.
  [[nodiscard]] std::vector<Subject> closest(std::size_t most) const;
  /// The worst job of a task: the first of its misses, or else the closest one.
  [[nodiscard]] std::optional<Subject> worst_of(TaskId task) const;
  /// Looks for a job, in another pass. Error: a damaged file.
  [[nodiscard]] Result<std::optional<Subject>> find(const JobId &job) const;
  /// The largest number of a job of the task.
  [[nodiscard]] std::uint32_t last_number(TaskId task) const { return survey_.tasks[task.value].last_number; }

  /// Explains jobs, each named once, in two passes. They come in order of their end. Error: a damaged file.
  [[nodiscard]] Result<void> explain(std::span<const Subject> subjects, const Visit &visit) const;
  /// The same, in the order of `subjects`.
  [[nodiscard]] Result<std::vector<Explanation>> explain(std::span<const Subject> subjects) const;

 private:
  struct Ranked {
    double share = 0;            // of the deadline
    std::uint64_t sequence = 0;  // of equal shares the first comes first
    Subject subject;
  };
  struct WorstOfTask {
    std::optional<Ranked> late;
    std::optional<Ranked> lost;
    std::optional<Ranked> closest;
    std::uint32_t last_number = 0;
  };
  struct Survey {
    std::uint64_t counted = 0;
    std::uint64_t missed = 0;
    std::uint64_t late_end_to_end = 0;
    std::vector<Subject> misses;
    std::vector<WorstOfTask> tasks;  // by TaskId
  };
  class Surveyor;
  class Explainer;

  explicit Investigation(const trace::Recording &run);
  static bool is_worse(const Ranked &a, const Ranked &b);
  [[nodiscard]] Miss miss_of(const JobRecord &job) const;

  trace::Recording run_;
  std::vector<Duration> end_to_end_;  // by TaskId: the deadline; 0: none
  Survey survey_;
};

/// The culprits of one job's parts: parts of one cause and one task together, the largest first. Work
/// (is_work()) comes last.
[[nodiscard]] std::vector<Culprit> culprits_of(std::span<const Part> parts);

/// The culprits of one job, its main cause first: the largest one, or why the job was lost where that says more
/// (an exception, a full queue).
[[nodiscard]] std::vector<Culprit> culprits_of(const Explanation &explanation);

/// The kind of cause that delayed most jobs most, with its culprits.
struct MainCause {
  std::size_t jobs = 0;
  std::vector<Culprit> culprits;  // of one cause, the one that delayed most jobs most first; not empty
};

/// Chooses among the culprits of several jobs, as CulpritCount::sorted() returns them. None if no job has a cause.
[[nodiscard]] std::optional<MainCause> main_cause_of(std::span<const Culprit> culprits);

/// Adds up the culprits of several jobs.
class CulpritCount {
 public:
  void add(const Explanation &explanation);
  /// Those that delayed most jobs most come first.
  [[nodiscard]] std::vector<Culprit> sorted() const;

 private:
  std::map<std::pair<Cause, TaskId>, Culprit> found_;
};

}  // namespace redag::metrics
