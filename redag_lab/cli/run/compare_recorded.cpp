// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/compare_recorded.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/trace/events_file.hpp"
#include "redag/trace/trace.hpp"
#include "redag_lab/cli/run/difference_report.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

constexpr std::size_t kMostShown = 10;

// Returns "a, b, c and 7 more".
std::string some_of(const std::vector<std::string> &items) {
  std::string text;
  for (std::size_t i = 0; i < std::min(items.size(), kMostShown); ++i) text += (i == 0 ? "" : ", ") + items[i];
  return items.size() > kMostShown ? fmt::format("{} and {} more", text, items.size() - kMostShown) : text;
}

class RecordedComparison {
 public:
  RecordedComparison(const CompareRecordedOptions &options, Console &console)
      : options_(options), console_(console), progress_(console) {}

  int run() {
    const InterruptGuard guard;
    diffed_.tolerance = options_.tolerance;
    if (!read(options_.a, diffed_.a) || !read(options_.b, diffed_.b)) return kExitBad;
    if (!compare_workloads()) return kExitBad;
    for (std::string &caveat : caveats(diffed_.a, diffed_.b)) diffed_.warnings.push_back(std::move(caveat));
    progress_.draw(1, "comparing");
    diffed_.difference = lab::compare_sides(diffed_.a.jobs, diffed_.b.jobs, diffed_.tolerance);
    progress_.clear();
    console_.say(describe(diffed_, console_.out_traits(), options_.all_tasks));
    return options_.check && diffed_.difference.is_any(lab::Verdict::Worse) ? kExitNo : kExitOk;
  }

 private:
  // Reads one side. Returns false after printing an error.
  bool read(const std::string &place, DiffSide &side) {
    const Result<RecordedPlaces> found = find_recorded_runs({place});
    if (!ok(found, console_)) return false;
    side.name = place;
    for (const std::string &note : found->notes) diffed_.warnings.push_back(fmt::format("{}: {}", place, note));
    std::vector<std::string> traces;
    std::vector<std::string> labels;
    for (const RecordedRuns &runs : found->runs) {
      traces.insert(traces.end(), runs.traces.begin(), runs.traces.end());
      labels.push_back(runs.label);
    }
    for (std::size_t i = 0; i < traces.size(); ++i) {
      if (InterruptGuard::interrupted()) {
        progress_.clear();
        console_.error("interrupted before both sides were read: there is nothing to compare");
        return false;
      }
      progress_.draw(static_cast<double>(i) / static_cast<double>(traces.size()), traces[i]);
      Result<trace::EventsReader> reader = trace::EventsReader::open(traces[i]);
      if (!reader) return fail(reader.error());
      const std::string other = difference_to(side, reader->info());
      if (!other.empty()) {
        progress_.clear();
        if (labels.size() > 1) {
          console_.error(fmt::format("{} holds runs of several kinds: {}", place, some_of(labels)),
                         fmt::format("name one of them, such as {}/{}", place, labels.front()));
        } else {
          console_.error(fmt::format("{} is not a repetition of the runs beside it: {}", traces[i], other),
                         "keep only runs of one kind in a folder");
        }
        return false;
      }
      side.jobs.begin_run(reader->info());
      const Result<void> read = reader->visit([&side](auto events) { side.jobs.add_events(events); });
      if (!read) return fail(read.error());
      side.jobs.end_run();
    }
    progress_.clear();
    return true;
  }

  // Returns the reason why a run is no repetition of the earlier ones; empty: it is one.
  static std::string difference_to(const DiffSide &side, const trace::RunInfo &run) {
    if (side.jobs.runs().empty()) return {};
    const trace::RunInfo &first = side.jobs.runs().front();
    const bool same_way = first.executor == run.executor && first.preemption == run.preemption &&
                          first.driver == run.driver && trace::worker_count(first) == trace::worker_count(run);
    if (!same_way) return "the executor, preemption mode, number of workers or driver differs";
    const std::vector<lab::Change> changes = lab::changes_between(first.workload, run.workload);
    return changes.empty() ? std::string() : changes.front().text();
  }

  bool fail(const Diagnostics &errors) {
    progress_.clear();
    console_.note(errors);
    return false;
  }

  // Only workloads with the same demand can be compared. Otherwise a difference does not describe the scheduling.
  bool compare_workloads() {
    diffed_.changes =
        lab::changes_between(diffed_.a.jobs.runs().front().workload, diffed_.b.jobs.runs().front().workload);
    std::vector<std::string> demand;
    for (const lab::Change &change : diffed_.changes) {
      if (change.kind == lab::Change::Kind::Demand) demand.push_back(change.text());
    }
    if (demand.empty()) return true;
    const std::string what = fmt::format("the two sides ran different workloads: {}", some_of(demand));
    if (!options_.different) {
      console_.error(what, "--different compares the tasks that both sides have");
      return false;
    }
    diffed_.warnings.push_back(what);
    return true;
  }

  const CompareRecordedOptions &options_;
  Console &console_;
  Progress progress_;
  Diffed diffed_;
};

}  // namespace

int compare_recorded(const CompareRecordedOptions &options, Console &console) {
  return RecordedComparison(options, console).run();
}

}  // namespace redag::cli
