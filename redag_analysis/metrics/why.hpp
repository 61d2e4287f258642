// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explains where the time of a job went, from its release to its end, or end to end: backwards along the data that it
// waited for. The parts of an explanation sum exactly to that time. A part has a cause only where the trace, or the
// kernel's record of the run, shows it; other time is called unknown. why_text.hpp has the words. Not thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/metrics/why_cause.hpp"
#include "redag_analysis/metrics/why_kernel.hpp"
#include "redag_analysis/metrics/why_links.hpp"

namespace redag::metrics {

/// What to explain: a job, by its index in Investigation::jobs(), and from when on.
struct Subject {
  std::size_t job = 0;
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
  std::string program;   // as Part::program
  std::size_t jobs = 0;  // explained jobs that it delayed
  std::size_t main = 0;  // of these, jobs that it delayed most
  Duration time = 0;

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
  /// `trace` and `kernel` (null: there is none) must outlive this object.
  explicit Investigation(const trace::Trace &trace, const KernelRecord *kernel = nullptr);

  [[nodiscard]] const trace::RunInfo &run() const { return trace_.info; }
  [[nodiscard]] const std::vector<JobRecord> &jobs() const { return links_.jobs(); }
  [[nodiscard]] Miss miss(std::size_t job) const;
  /// The number of jobs that were not released during the warm-up.
  [[nodiscard]] std::size_t counted() const;
  [[nodiscard]] std::optional<std::size_t> find(const JobId &job) const;

  /// The jobs that missed a deadline: the latest first, relative to the deadline; then lost ones. Those released during
  /// the warm-up do not count. One that misses only its DAG's deadline is to be explained end to end.
  [[nodiscard]] std::vector<Subject> misses() const;
  /// Of each task the finished job that came closest to its deadline or missed it most; at most `most`, the worst
  /// first.
  [[nodiscard]] std::vector<Subject> closest(std::size_t most) const;

  [[nodiscard]] std::vector<Explanation> explain(std::span<const Subject> subjects) const;

 private:
  [[nodiscard]] bool counts(std::size_t job) const;
  [[nodiscard]] Subject subject_of(std::size_t job) const;
  [[nodiscard]] Duration deadline_of(const Subject &subject) const;
  [[nodiscard]] double closeness(const Subject &subject) const;

  const trace::Trace &trace_;
  JobLinks links_;
  std::vector<Duration> end_to_end_;  // by TaskId: the deadline; 0: none
  std::optional<KernelView> kernel_;
};

/// The culprits of one job's parts: parts of one cause and one task or program together, the largest first. Work
/// (is_work()) comes last.
[[nodiscard]] std::vector<Culprit> culprits_of(std::span<const Part> parts);

/// The culprits of several jobs together, those that delayed most jobs most first.
[[nodiscard]] std::vector<Culprit> culprits_of(std::span<const Explanation> explanations);

}  // namespace redag::metrics
