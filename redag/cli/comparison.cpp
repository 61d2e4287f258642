#include "redag/cli/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/cli/table.hpp"

namespace redag::cli {
namespace {

Observation observe(const metrics::JobStats &jobs, const metrics::Distribution &end_to_end) {
  Observation seen;
  seen.jobs = jobs.released;
  seen.finished = jobs.finished;
  seen.late = jobs.late;
  seen.skipped = jobs.skipped;
  seen.aborted = jobs.aborted;
  seen.miss_ratio = jobs.miss_ratio();
  seen.miss_ratio_with_lost = jobs.miss_ratio_with_lost();
  seen.response = jobs.response;
  seen.end_to_end = end_to_end;
  return seen;
}

template <class Value>
Spread spread_over(const ExecutorResults &results, std::size_t dag, Value value) {
  std::vector<double> values;
  for (const auto &repetition : results.repetitions) values.push_back(static_cast<double>(value(repetition[dag])));
  return report::spread_of(std::move(values));
}

// Who misses fewest, and who cannot be told from that.
std::string conclusion(const Comparison &comparison, std::size_t dag) {
  std::vector<report::Contender> contenders;
  for (const ExecutorResults &results : comparison.executors) {
    contenders.push_back({results.variant.name, results.miss(dag)});
  }
  return report::ranking(contenders);
}

std::string time_text(const Spread &spread) { return humanize_duration(static_cast<Duration>(spread.median)); }

// "14.2 %", and the range where repetitions differ: "14.2 % (13.9..14.8)".
std::string miss_text(const Spread &miss) {
  const std::string median = format_percent(miss.median);
  const std::string low = fmt::format("{:.1f}", 100 * miss.min);
  const std::string high = fmt::format("{:.1f}", 100 * miss.max);
  return low == high ? median : fmt::format("{} ({}..{})", median, low, high);
}

Json to_json(const Spread &spread) { return Json{{"median", spread.median}, {"min", spread.min}, {"max", spread.max}}; }

Json to_json(const metrics::Distribution &d) {
  return Json{{"count", d.count}, {"mean_ns", d.mean}, {"min_ns", d.min}, {"p50_ns", d.p50},
              {"p90_ns", d.p90},  {"p95_ns", d.p95},   {"p99_ns", d.p99}, {"max_ns", d.max}};
}

Json to_json(const Observation &seen) {
  return Json{{"released", seen.jobs},
              {"finished", seen.finished},
              {"late", seen.late},
              {"skipped", seen.skipped},
              {"aborted", seen.aborted},
              {"miss_ratio", seen.miss_ratio},
              {"miss_ratio_with_lost", seen.miss_ratio_with_lost},
              {"response", to_json(seen.response)},
              {"end_to_end", to_json(seen.end_to_end)}};
}

Json dag_json(const ExecutorResults &results, const std::string &name, std::size_t dag) {
  Json repetitions = Json::array();
  for (const auto &repetition : results.repetitions) repetitions.push_back(to_json(repetition[dag]));
  return Json{{"name", name},
              {"miss_ratio", to_json(results.late(dag))},
              {"miss_ratio_with_lost", to_json(results.miss(dag))},
              {"response_p50_ns", to_json(results.response(dag, &metrics::Distribution::p50))},
              {"response_p95_ns", to_json(results.response(dag, &metrics::Distribution::p95))},
              {"response_p99_ns", to_json(results.response(dag, &metrics::Distribution::p99))},
              {"response_max_ns", to_json(results.response(dag, &metrics::Distribution::max))},
              {"repetitions", repetitions}};
}

// RFC 4180.
std::string quoted(const std::string &text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + "\"";
}

std::string comparison_table(const Comparison &comparison, const StreamTraits &terminal) {
  Table table({{"DAG", false, 9},
               {"executor", false, 9, true},
               {"jobs", true, 2},
               {"late", true, 5},
               {"missed", true, 8},
               {"p50", true, 3},
               {"p95", true, 1},
               {"p99", true, 6},
               {"max", true, 4}});
  for (std::size_t dag = 0; dag < comparison.dags.size(); ++dag) {
    for (const ExecutorResults &results : comparison.executors) {
      const Spread miss = results.miss(dag);
      const auto time = [&](Duration metrics::Distribution::*value) {
        return Cell{time_text(results.response(dag, value))};
      };
      table.add({{&results == &comparison.executors.front() ? comparison.dags[dag] : ""},
                 {results.variant.name},
                 {format_count(results.jobs(dag))},
                 {format_percent(results.late(dag).median)},
                 {miss_text(miss), miss.median > 0 ? Tint::Bad : Tint::Good},
                 time(&metrics::Distribution::p50),
                 time(&metrics::Distribution::p95),
                 time(&metrics::Distribution::p99),
                 time(&metrics::Distribution::max)});
    }
  }
  return table.render(terminal.width, terminal.colour);
}

}  // namespace

void ExecutorResults::add(const Session &session) {
  std::vector<Observation> seen;
  for (const metrics::DagSummary &dag : session.summary.dags)
    seen.push_back(observe(dag.jobs, dag.end_to_end.response));
  seen.push_back(observe(session.summary.total, {}));
  repetitions.push_back(std::move(seen));
  preemption = session.info.preemption;
  preemption_why = session.info.preemption_why;
  realtime = session.realtime_threads;
  check_violations += session.check.violation_count;
  for (const std::string &warning : session.warnings) {
    if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end()) warnings.push_back(warning);
  }
}

Spread ExecutorResults::miss(std::size_t dag) const {
  return spread_over(*this, dag, [](const Observation &seen) { return seen.miss_ratio_with_lost; });
}

Spread ExecutorResults::late(std::size_t dag) const {
  return spread_over(*this, dag, [](const Observation &seen) { return seen.miss_ratio; });
}

Spread ExecutorResults::response(std::size_t dag, Duration metrics::Distribution::*value) const {
  return spread_over(*this, dag, [value](const Observation &seen) { return seen.response.*value; });
}

std::uint64_t ExecutorResults::jobs(std::size_t dag) const {
  std::uint64_t all = 0;
  for (const auto &repetition : repetitions) all += repetition[dag].jobs;
  return all;
}

std::vector<std::string> verdicts(const Comparison &comparison) {
  std::vector<std::string> lines;
  for (std::size_t dag = 0; dag + 1 < comparison.dags.size(); ++dag) {
    std::string line = comparison.dags[dag] + ": ";
    bool any = false;
    for (const ExecutorResults &results : comparison.executors) {
      const Spread miss = results.miss(dag);
      any = any || miss.max > 0;
      const bool first = &results == &comparison.executors.front();
      line += fmt::format("{}{} {}{}", first ? "" : ", ", results.variant.name, first ? "misses " : "",
                          format_percent(miss.median));
    }
    lines.push_back(line + ": " + (any ? conclusion(comparison, dag) : "nobody misses"));
  }
  return lines;
}

std::string caveat(const Comparison &comparison) {
  std::vector<std::string> with;
  std::vector<std::string> without;
  for (const ExecutorResults &results : comparison.executors) {
    (results.realtime ? with : without).push_back(results.variant.name);
  }
  if (with.empty() || without.empty()) return {};
  return fmt::format(
      "{} had real-time (SCHED_FIFO) threads, {} had not: on a busy machine part of the difference is that alone; "
      "mte-fifo and ste-fifo, or --realtime, give them to everybody",
      report::join(with), report::join(without));
}

std::string describe(const Comparison &comparison, const StreamTraits &terminal) {
  const std::size_t repetitions = comparison.executors.front().repetitions.size();
  const bool simulated = comparison.driver == trace::Driver::Simulator;
  std::string text = fmt::format("{}: {} worker{}, {} repetition{} of {} {}, seed {}\n", comparison.workload,
                                 comparison.workers, comparison.workers == 1 ? "" : "s", repetitions,
                                 repetitions == 1 ? "" : "s", humanize_duration(comparison.duration),
                                 simulated ? "in virtual time" : "on threads", comparison.seed);
  for (const ExecutorResults &results : comparison.executors) {
    text += fmt::format("  {}: preemption {}{}\n", results.variant.name, results.preemption,
                        results.preemption_why.empty() ? "" : " (" + results.preemption_why + ")");
  }
  text += "\n" + comparison_table(comparison, terminal);
  text += fmt::format("late: late jobs / released; missed: late, skipped or aborted / released{}\n",
                      repetitions > 1 ? "; medians, and (lowest..highest) repetition" : "");
  text += "response times p50 to max: finish - release of all jobs of the DAG\n\n";
  for (const std::string &line : verdicts(comparison)) text += line + "\n";
  if (const std::string unfair = caveat(comparison); !unfair.empty()) text += "note: " + unfair + "\n";
  std::string violated;
  for (const ExecutorResults &results : comparison.executors) {
    if (results.check_violations == 0) continue;
    violated += fmt::format("{}{}: {} violations", violated.empty() ? "" : ", ", results.variant.name,
                            format_count(results.check_violations));
  }
  text += "trace check: " +
          (violated.empty() ? tinted("ok", Tint::Good, terminal.colour) + ", every run"
                            : tinted(violated, Tint::Bad, terminal.colour)) +
          "\n";
  return text;
}

Json to_json(const Comparison &comparison) {
  Json executors = Json::array();
  for (const ExecutorResults &results : comparison.executors) {
    Json dags = Json::array();
    for (std::size_t dag = 0; dag < comparison.dags.size(); ++dag) {
      Json row = dag_json(results, comparison.dags[dag], dag);
      if (dag + 1 < comparison.dags.size()) dags.push_back(std::move(row));
    }
    const std::size_t total = comparison.dags.size() - 1;
    executors.push_back(Json{{"name", results.variant.name},
                             {"executor", results.variant.executor},
                             {"preemption", results.preemption},
                             {"preemption_why", results.preemption_why},
                             {"realtime_threads", results.realtime},
                             {"repetitions", results.repetitions.size()},
                             {"check_violations", results.check_violations},
                             {"warnings", results.warnings},
                             {"dags", dags},
                             {"total", dag_json(results, "total", total)}});
  }
  return Json{{"format", "redag.comparison/1"},
              {"workload", comparison.workload},
              {"driver", trace::to_string(comparison.driver)},
              {"workers", comparison.workers},
              {"duration_ns", comparison.duration},
              {"seed", comparison.seed},
              {"executors", executors},
              {"verdicts", verdicts(comparison)},
              {"caveat", caveat(comparison)},
              {"warnings", comparison.warnings}};
}

std::string to_csv(const Comparison &comparison) {
  std::string text =
      "executor,dag,repetition,released,finished,late,skipped,aborted,miss_ratio,miss_ratio_with_lost,"
      "response_p50_ns,response_p95_ns,response_p99_ns,response_max_ns,"
      "end_to_end_p50_ns,end_to_end_p95_ns,end_to_end_p99_ns,end_to_end_max_ns\n";
  for (const ExecutorResults &results : comparison.executors) {
    for (std::size_t r = 0; r < results.repetitions.size(); ++r) {
      for (std::size_t dag = 0; dag + 1 < comparison.dags.size(); ++dag) {
        const Observation &seen = results.repetitions[r][dag];
        text += fmt::format("{},{},{},{},{},{},{},{},{:.9g},{:.9g},{},{},{},{},{},{},{},{}\n", results.variant.name,
                            quoted(comparison.dags[dag]), r + 1, seen.jobs, seen.finished, seen.late, seen.skipped,
                            seen.aborted, seen.miss_ratio, seen.miss_ratio_with_lost, seen.response.p50,
                            seen.response.p95, seen.response.p99, seen.response.max, seen.end_to_end.p50,
                            seen.end_to_end.p95, seen.end_to_end.p99, seen.end_to_end.max);
      }
    }
  }
  return text;
}

}  // namespace redag::cli
