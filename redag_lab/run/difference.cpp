// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/difference.hpp"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "redag/base/check.hpp"
#include "redag/base/rng.hpp"

namespace redag::lab {
namespace {

constexpr Duration kMostBlocks = 30;

Duration longest_period(const Workload &workload) {
  Duration longest = 1;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) longest = std::max(longest, task.period);
  }
  return longest;
}

// Returns a multiple of the longest period, at least two of them and long enough for at most 30 blocks. Every block
// then sees the same releases.
Duration block_length(Duration run, Duration period) {
  return period * std::max<Duration>(2, (run + kMostBlocks * period - 1) / (kMostBlocks * period));
}

bool is_row(const DifferenceSide::Row &a, const DifferenceSide::Row &b) { return a.dag == b.dag && a.task == b.task; }

std::string name_of(const DifferenceSide::Row &row) { return row.task.empty() ? row.dag : row.dag + "." + row.task; }

Verdict verdict_of(const FigureDifference &figure, double threshold) {
  if (!figure.tested) return Verdict::NotTested;
  if (figure.p() > threshold) return Verdict::Same;
  return figure.p_more < figure.p_less ? Verdict::Worse : Verdict::Better;
}

}  // namespace

const char *to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::Same: return "same";
    case Verdict::Better: return "better";
    case Verdict::Worse: return "worse";
    case Verdict::NotTested: return "not tested";
  }
  return "?";
}

void DifferenceSide::make_rows(const Workload &workload) {
  const std::vector<bool> is_sink = metrics::sinks_of(workload);
  rows_.push_back({});
  for (const Dag &dag : workload.dags) {
    const std::size_t dag_row = rows_.size();
    rows_.emplace_back().dag = dag.name;
    const auto first = is_sink.begin() + static_cast<std::ptrdiff_t>(places_.size());
    const bool one_sink = std::count(first, first + static_cast<std::ptrdiff_t>(dag.tasks.size()), true) == 1;
    for (const Task &task : dag.tasks) {
      const bool ends_dag = one_sink && is_sink[places_.size()];
      places_.push_back(Places{dag_row, rows_.size(), ends_dag ? std::optional<std::size_t>(dag_row) : std::nullopt});
      Row &row = rows_.emplace_back();
      row.dag = dag.name;
      row.task = task.name;
    }
  }
}

void DifferenceSide::begin_run(const trace::RunInfo &run) {
  if (runs_.empty()) make_rows(run.workload);
  REDAG_CHECK(places_.size() == run.workload.task_count(), "runs of different tasks on one side");
  runs_.push_back(run);
  const Time begin = run.start + run.warm_up;
  const Duration length = std::max<Duration>(1, run.end - begin);
  const Duration block = block_length(length, longest_period(run.workload));
  const auto blocks = static_cast<std::size_t>(std::max<Duration>(1, length / block));
  for (Row &row : rows_) row.runs.emplace_back(blocks);
  counting_.emplace(Counting{metrics::JobFolder(run.workload), begin, block});
}

void DifferenceSide::add_events(std::span<const JobEvent> events) {
  counting_->folder.add(events);
  counting_->folder.drain_ended([this](const metrics::JobRecord &job) { count(job); });
}

void DifferenceSide::end_run() {
  for (const metrics::JobRecord &job : counting_->folder.in_flight()) count(job);
  counting_.reset();
}

void DifferenceSide::add(const trace::Trace &trace) {
  begin_run(trace.info);
  add_events(trace.events);
  end_run();
}

void DifferenceSide::count(const metrics::JobRecord &job) {
  if (job.release < counting_->begin) return;
  const std::size_t blocks = rows_.front().runs.back().size();
  const auto block = static_cast<std::size_t>((job.release - counting_->begin) / counting_->block);
  const std::size_t at = std::min(blocks - 1, block);
  const metrics::Miss miss = metrics::miss_of(job, runs_.back().end);
  const Places &places = places_[job.task.value];
  for (const std::size_t index : {std::size_t{0}, places.dag, places.task}) {
    Row &row = rows_[index];
    row.jobs.count(job, miss);
    Block &here = row.runs.back()[at];
    ++here.released;
    if (miss != metrics::Miss::None) ++here.missed;
  }
  if (job.outcome != metrics::JobOutcome::Finished) return;
  const auto respond = [&](Row &row, Duration response) {
    row.max = std::max(row.max, response);
    row.runs.back()[at].responses.push_back(response);
  };
  respond(rows_[places.task], job.response());
  if (places.end_to_end) respond(rows_[*places.end_to_end], job.finish - job.origin);
}

bool DifferenceSide::Row::has_responses() const {
  return std::any_of(runs.begin(), runs.end(), [](const std::vector<Block> &run) {
    return std::any_of(run.begin(), run.end(), [](const Block &block) { return !block.responses.empty(); });
  });
}

bool Difference::is_any(Verdict verdict) const {
  return std::any_of(rows.begin(), rows.end(), [&](const DifferenceRow &row) { return row.is_any(verdict); });
}

Difference compare_sides(const DifferenceSide &a, const DifferenceSide &b, const BootstrapOptions &options) {
  REDAG_CHECK(!a.runs().empty() && !b.runs().empty(), "a side without runs");
  Difference difference;
  for (const DifferenceSide::Row &row : a.rows()) {
    const auto other =
        std::find_if(b.rows().begin(), b.rows().end(), [&](const auto &candidate) { return is_row(row, candidate); });
    if (other == b.rows().end()) {
      difference.missing.push_back(name_of(row));
    } else {
      difference.rows.push_back(DifferenceRow{&row, &*other, {}});
    }
  }
  for (const DifferenceSide::Row &row : b.rows()) {
    const bool known =
        std::any_of(a.rows().begin(), a.rows().end(), [&](const auto &other) { return is_row(row, other); });
    if (!known) difference.missing.push_back(name_of(row));
  }

  std::vector<DifferenceRow> &rows = difference.rows;
  tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
    BootstrapOptions row_options = options;
    row_options.seed = mix(options.seed ^ mix(i));
    rows[i].figures = compare_blocks(rows[i].a->runs, rows[i].b->runs, row_options);
  });

  std::vector<double> p_values;
  for (const DifferenceRow &row : rows) {
    for (const FigureDifference *figure :
         {&row.figures.miss_ratio, &row.figures.p50, &row.figures.p95, &row.figures.p99}) {
      if (figure->tested) p_values.push_back(figure->p());
    }
  }
  difference.tests = p_values.size();
  difference.threshold = discovery_threshold(std::move(p_values));
  for (DifferenceRow &row : rows) {
    row.miss = verdict_of(row.figures.miss_ratio, difference.threshold);
    row.p50 = verdict_of(row.figures.p50, difference.threshold);
    row.p95 = verdict_of(row.figures.p95, difference.threshold);
    row.p99 = verdict_of(row.figures.p99, difference.threshold);
  }
  return difference;
}

}  // namespace redag::lab
