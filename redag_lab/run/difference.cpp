// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/difference.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/check.hpp"
#include "redag_analysis/metrics/distribution.hpp"

namespace redag::lab {
namespace {

constexpr std::array<double, 3> kPercents = {50, 95, 99};

Duration longest_period(const Workload &workload) {
  Duration longest = 1;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) longest = std::max(longest, task.period);
  }
  return longest;
}

// Returns a multiple of the longest period: every stretch then sees the same releases.
Duration stretch_length(Duration run, Duration period) {
  return period * std::max<Duration>(2, (run + kStretches * period - 1) / (kStretches * period));
}

bool is_row(const DifferenceSide::Row &a, const DifferenceSide::Row &b) { return a.dag == b.dag && a.task == b.task; }

using Jobs = DifferenceSide::Jobs;

void add(Jobs &sum, const Jobs &jobs) {
  sum.released += jobs.released;
  sum.missed += jobs.missed;
  sum.responses.insert(sum.responses.end(), jobs.responses.begin(), jobs.responses.end());
}

// Returns the jobs of each sample, with sorted responses: of whole runs, or of stretches in which jobs were released.
std::vector<Jobs> samples_of(const DifferenceSide::Row &row, bool of_runs) {
  std::vector<Jobs> samples;
  for (const std::vector<Jobs> &run : row.runs) {
    if (of_runs) samples.emplace_back();
    for (const Jobs &stretch : run) {
      if (!of_runs && stretch.released > 0) samples.push_back(stretch);
      if (of_runs) add(samples.back(), stretch);
    }
  }
  for (Jobs &sample : samples) std::sort(sample.responses.begin(), sample.responses.end());
  return samples;
}

double miss_ratio(const Jobs &jobs) {
  return jobs.released == 0 ? 0 : static_cast<double>(jobs.missed) / static_cast<double>(jobs.released);
}

double response(const Jobs &jobs, double percent) {
  return jobs.responses.empty() ? 0 : static_cast<double>(metrics::percentile(jobs.responses, percent));
}

// Tests whether the values of B are larger, or smaller, by more than the tolerance.
void test(const std::vector<double> &a, const std::vector<double> &b, double tolerance, FigureDifference &figure) {
  const auto scaled = [&a](double factor) {
    std::vector<double> values = a;
    for (double &value : values) value *= factor;
    return values;
  };
  const double more = p_larger(scaled(1 + tolerance), b);
  const double less = p_larger(b, scaled(1 - tolerance));
  figure.p = std::min(1.0, 2 * std::min(more, less));
  figure.is_more = more < less;
}

template <class Figure>
std::vector<double> values_of(const std::vector<Jobs> &samples, Figure figure) {
  std::vector<double> values;
  for (const Jobs &sample : samples) values.push_back(figure(sample));
  return values;
}

void compare_rows(DifferenceRow &row, bool of_runs, double tolerance) {
  const std::vector<Jobs> a = samples_of(*row.a, of_runs);
  const std::vector<Jobs> b = samples_of(*row.b, of_runs);
  Jobs all_a;
  Jobs all_b;
  for (const Jobs &sample : a) add(all_a, sample);
  for (const Jobs &sample : b) add(all_b, sample);
  for (Jobs *all : {&all_a, &all_b}) std::sort(all->responses.begin(), all->responses.end());
  row.miss_ratio.a = miss_ratio(all_a);
  row.miss_ratio.b = miss_ratio(all_b);
  const bool is_enough = std::min(a.size(), b.size()) >= (of_runs ? kFewestRuns : kFewestStretches);
  if (is_enough) test(values_of(a, miss_ratio), values_of(b, miss_ratio), 0, row.miss_ratio);
  for (std::size_t p = 0; p < kPercents.size(); ++p) {
    FigureDifference &figure = row.responses[p];
    figure.a = response(all_a, kPercents[p]);
    figure.b = response(all_b, kPercents[p]);
    const auto has_beyond = [&](const Jobs &jobs) {
      return static_cast<double>(jobs.responses.size()) * (100 - kPercents[p]) >= 100;
    };
    if (!is_enough || !std::all_of(a.begin(), a.end(), has_beyond) || !std::all_of(b.begin(), b.end(), has_beyond)) {
      continue;
    }
    const auto at = [&](const Jobs &jobs) { return response(jobs, kPercents[p]); };
    test(values_of(a, at), values_of(b, at), tolerance, figure);
  }
}

template <class Visit>
void for_each_figure(std::vector<DifferenceRow> &rows, Visit visit) {
  for (DifferenceRow &row : rows) {
    visit(row.miss_ratio);
    for (FigureDifference &figure : row.responses) visit(figure);
  }
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
  const Duration stretch = stretch_length(length, longest_period(run.workload));
  const auto stretches = static_cast<std::size_t>(std::max<Duration>(1, length / stretch));
  for (Row &row : rows_) row.runs.emplace_back(stretches);
  counting_.emplace(Counting{metrics::JobFolder(run.workload), begin, stretch});
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
  const std::size_t stretches = rows_.front().runs.back().size();
  const auto stretch = static_cast<std::size_t>((job.release - counting_->begin) / counting_->stretch);
  const std::size_t at = std::min(stretches - 1, stretch);
  const metrics::Miss miss = metrics::miss_of(job, runs_.back().end);
  const Places &places = places_[job.task.value];
  for (const std::size_t index : {std::size_t{0}, places.dag, places.task}) {
    Row &row = rows_[index];
    row.jobs.count(job, miss);
    Jobs &here = row.runs.back()[at];
    ++here.released;
    if (miss != metrics::Miss::None) ++here.missed;
  }
  if (job.outcome != metrics::JobOutcome::Finished) return;
  rows_[places.task].runs.back()[at].responses.push_back(job.response());
  if (places.end_to_end) rows_[*places.end_to_end].runs.back()[at].responses.push_back(job.finish - job.origin);
}

bool DifferenceSide::Row::has_responses() const {
  return std::any_of(runs.begin(), runs.end(), [](const std::vector<Jobs> &run) {
    return std::any_of(run.begin(), run.end(), [](const Jobs &stretch) { return !stretch.responses.empty(); });
  });
}

bool DifferenceRow::is_any(Verdict verdict) const {
  const auto is_it = [verdict](const FigureDifference &figure) { return figure.verdict == verdict; };
  return is_it(miss_ratio) || std::any_of(responses.begin(), responses.end(), is_it);
}

bool Difference::is_any(Verdict verdict) const {
  return std::any_of(rows.begin(), rows.end(), [&](const DifferenceRow &row) { return row.is_any(verdict); });
}

Difference compare_sides(const DifferenceSide &a, const DifferenceSide &b, double tolerance) {
  REDAG_CHECK(!a.runs().empty() && !b.runs().empty(), "a side without runs");
  Difference difference;
  difference.of_runs = std::min(a.runs().size(), b.runs().size()) >= kFewestRuns;
  const auto find_in = [](const DifferenceSide &side, const DifferenceSide::Row &wanted) {
    const auto found =
        std::find_if(side.rows().begin(), side.rows().end(), [&](const auto &row) { return is_row(row, wanted); });
    return found == side.rows().end() ? nullptr : &*found;
  };
  for (const DifferenceSide::Row &row : a.rows()) {
    if (const DifferenceSide::Row *other = find_in(b, row)) {
      compare_rows(difference.rows.emplace_back(DifferenceRow{&row, other, {}, {}}), difference.of_runs, tolerance);
    }
  }

  std::vector<double> p_values;
  for_each_figure(difference.rows, [&](const FigureDifference &figure) {
    if (figure.p) p_values.push_back(*figure.p);
  });
  const double threshold = discovery_threshold(std::move(p_values));
  for_each_figure(difference.rows, [&](FigureDifference &figure) {
    if (!figure.p) return;
    const bool differs = *figure.p <= threshold;
    figure.verdict = !differs ? Verdict::Same : figure.is_more ? Verdict::Worse : Verdict::Better;
  });
  return difference;
}

double p_larger(std::span<const double> a, std::span<const double> b) {
  std::vector<std::pair<double, bool>> values;  // with "is of b"
  for (const double value : a) values.emplace_back(value, false);
  for (const double value : b) values.emplace_back(value, true);
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double ranks_of_b = 0;  // the sum; equal values have their mean rank
  double ties = 0;
  for (std::size_t i = 0; i < values.size();) {
    std::size_t end = i;
    double of_b = 0;
    for (; end < values.size() && values[end].first == values[i].first; ++end) of_b += values[end].second ? 1 : 0;
    const auto equal = static_cast<double>(end - i);
    ranks_of_b += of_b * (static_cast<double>(i + end) + 1) / 2;
    ties += equal * equal * equal - equal;
    i = end;
  }
  const auto size_a = static_cast<double>(a.size());
  const auto size_b = static_cast<double>(b.size());
  const double above_mean = ranks_of_b - size_b * (n + 1) / 2;
  const double variance = size_a * size_b / 12 * (n + 1 - ties / (n * (n - 1)));
  if (variance <= 0) return 1;  // all values are equal
  return std::erfc((above_mean - 0.5) / std::sqrt(2 * variance)) / 2;
}

double discovery_threshold(std::vector<double> p_values, double rate) {
  std::sort(p_values.begin(), p_values.end());
  const auto n = static_cast<double>(p_values.size());
  for (std::size_t k = p_values.size(); k > 0; --k) {
    if (p_values[k - 1] <= rate * static_cast<double>(k) / n) return p_values[k - 1];
  }
  return 0;
}

}  // namespace redag::lab
