// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes the JSON document of factorial_results.hpp and the files.
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/base/provenance.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/version.hpp"
#include "redag_lab/experiment/factorial_results.hpp"
#include "redag_lab/experiment/folder.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;

Json levels_json(const Factorial &factorial, const FactorialPoint &point) {
  Json levels = Json::object();
  for (const Factor &factor : factorial.factors()) {
    if (const std::uint32_t level = point.of(factor.kind); level != kNoLevel) {
      levels[to_string(factor.kind)] = factor.levels[level];
    }
  }
  return levels;
}

Json row_json(const Factorial &factorial, const FactorialResults &results, const FactorialRow &row) {
  Json json = {{"factors", levels_json(factorial, factorial.points()[row.point])},
               {"repetitions", row.repetition.size()}};
  if (row.repetition.empty()) return json;
  std::set<std::string> worlds;
  std::set<std::string> modes;
  std::uint64_t violations = 0;
  bool enforced = true;
  for (const Observation &run : row.runs()) {
    worlds.insert(run.world);
    modes.insert(run.preemption);
    violations += run.violations;
    enforced = enforced && run.enforced;
  }
  json["world"] = worlds;
  json["preemption"] = modes;
  json["violations"] = violations;
  json["all_enforced"] = enforced;
  json["dags"] = Json::array();
  for (std::size_t dag = 0; dag < row.runs().front().dags.size(); ++dag) {
    Json metrics = {{"dag", row.runs().front().dags[dag].dag},
                    {"released", sum_over_runs(row, dag, Measure::Released)},
                    {"missed", sum_over_runs(row, dag, Measure::Missed)}};
    for (std::size_t m = 0; m < kMetricCount; ++m) {
      const auto metric = static_cast<Metric>(m);
      const std::optional<Median> median = over_runs(factorial, results, row, dag, metric);
      if (!median) continue;
      metrics["confidence"] = median->confidence;
      metrics[std::string(to_string(metric)) + (is_duration(metric) ? "_ns" : "")] = {median->median, median->low,
                                                                                      median->high};
    }
    json["dags"].push_back(std::move(metrics));
  }
  return json;
}

Json effects_json(const Factorial &factorial, const FactorialEffects &one) {
  Json json = {{"workload", factorial.plan().workloads[one.workload].name},
               {"executor", factorial.plan().executors[one.executor]},
               {"mean_miss_ratio", one.effects.mean},
               {"variance", one.effects.variance},
               {"shares", Json::array()},
               {"higher_interactions", one.effects.higher},
               {"noise", one.effects.noise},
               {"levels", Json::array()}};
  for (const Effects::Term &term : one.effects.terms) {
    Json names = Json::array();
    for (const std::size_t f : term.factors) names.push_back(to_string(one.factors[f]));
    json["shares"].push_back(Json{{"factors", std::move(names)}, {"share", term.share}});
  }
  for (std::size_t f = 0; f < one.factors.size(); ++f) {
    json["levels"].push_back(Json{{"factor", to_string(one.factors[f])}, {"miss_ratio", one.effects.levels[f]}});
  }
  return json;
}

}  // namespace

std::string to_json(const Factorial &factorial, const FactorialResults &results, const std::vector<std::string> &runs) {
  const FactorialPlan &plan = factorial.plan();
  Json document = {{"format", "redag.experiment.factorial/2"},
                   {"provenance", Json::parse(provenance_to_json(current_provenance()))},
                   {"name", plan.name},
                   {"version", kVersion},
                   {"plan", to_yaml(plan)},
                   {"world", to_string(plan.world)},
                   {"duration_ns", plan.duration},
                   {"repetitions", plan.repetitions},
                   {"units", results.units},
                   {"done", results.done},
                   {"complete", results.complete()},
                   {"checks", results.checks},
                   {"violations", results.violations},
                   {"runs_beyond_max_active", results.unenforced},
                   {"factors", Json::array()},
                   {"points", Json::array()},
                   {"effects", Json::array()},
                   {"runs", Json::array()}};
  for (const Factor &factor : factorial.factors()) {
    if (factor.levels.empty()) continue;
    document["factors"].push_back(
        Json{{"name", to_string(factor.kind)}, {"numeric", factor.numeric}, {"levels", factor.levels}});
  }
  for (const FactorialRow &row : results.rows) document["points"].push_back(row_json(factorial, results, row));
  for (const FactorialEffects &one : effects_of(factorial, results)) {
    document["effects"].push_back(effects_json(factorial, one));
  }
  for (const std::string &run : runs) document["runs"].push_back(Json::parse(run));
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<void> write_results(const std::string &folder, const Factorial &factorial, const FactorialResults &results) {
  const auto create = [&folder](const char *name) {
    return trace::OutputFile::create(fmt::format("{}/{}", folder, name));
  };
  std::vector<std::pair<const char *, std::string>> files = {
      {"factorial.csv", to_csv(factorial, results)},
      {"factorial.json", to_json(factorial, results, read_runs({folder}))},
      {"factorial.svg", to_svg(factorial, results)}};
  if (factorial.plan().quantiles) {
    files.emplace_back("response_quantiles.csv", quantiles_csv(factorial, results));
    files.emplace_back("responses.svg", responses_svg(factorial, results));
  }
  if (std::optional<std::string> distance = distance_svg(factorial, results)) {
    files.emplace_back("distance.svg", std::move(*distance));
  }
  for (const auto &[name, text] : files) {
    Result<trace::OutputFile> file = create(name);
    if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
    file->write(text);
    if (Result<void> done = file->commit(); !done) return done;
  }
  Result<trace::OutputFile> observations = create("observations.csv");
  if (!observations) return tl::unexpected<Diagnostics>(std::move(observations.error()));
  observations_csv(factorial, results, [&observations](std::string_view text) { observations->write(text); });
  return observations->commit();
}

}  // namespace redag::experiment
