// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/experiment.hpp"

#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace redag::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kFormat = "redag.experiment.factorial/2";
// The metrics that the page draws, in this order.
constexpr std::array kMetrics = {"miss_ratio",
                                 "drop_ratio",
                                 "excess_miss_ratio",
                                 "response_p50_ns",
                                 "response_p95_ns",
                                 "response_p99_ns",
                                 "response_max_ns",
                                 "max_lateness_ns",
                                 "deferred",
                                 "preemptions",
                                 "paper_miss_ratio",
                                 "finished_per_s",
                                 "work"};

// Rounds to four digits, which suffice for the page and make the file a tenth of the size.
double rounded(double value) {
  if (value == 0 || !std::isfinite(value)) return 0;
  const double unit = std::pow(10, std::floor(std::log10(std::abs(value))) - 3);
  return std::round(value / unit) * unit;
}

Json number(double value) {
  const double r = rounded(value);
  if (std::abs(r) >= 1000) return static_cast<std::int64_t>(std::llround(r));
  return Json::parse(fmt::format("{:.6g}", r));
}

Json dag_json(const Json &dag) {
  Json values = Json::array();
  for (const char *metric : kMetrics) {
    Json spread;
    if (const auto at = dag.find(metric); at != dag.end()) {
      spread = Json::array();
      for (const Json &value : *at) spread.push_back(number(value.get<double>()));
    }
    values.push_back(std::move(spread));
  }
  return Json{{"name", dag.at("dag")},
              {"released", dag.at("released")},
              {"missed", dag.at("missed")},
              {"confidence", dag.at("confidence")},
              {"values", std::move(values)}};
}

Json point_json(const Json &point) {
  Json dags = Json::array();
  for (const Json &dag : point.value("dags", Json::array())) dags.push_back(dag_json(dag));
  return Json{{"at", point.at("factors")},
              {"worlds", point.value("world", Json::array())},  // empty until a run is finished
              {"repetitions", point.at("repetitions")},
              {"dags", std::move(dags)}};
}

}  // namespace

Result<ExperimentDocument> experiment_document(std::string_view text, const std::string &file,
                                               const Provenance &provenance) {
  const auto mistake = [&](const std::string &message) {
    return tl::unexpected<Diagnostics>(Diagnostics{
        Diagnostic{Severity::Error, file, 0, 0, message, "'redag experiment factorial PLAN --out DIR' writes one"}});
  };
  try {
    const Json from = Json::parse(text);
    if (from.value("format", "") != kFormat) return mistake(fmt::format("is not a {} document", kFormat));
    Json to = {{"kind", "factorial"}};
    to["provenance"] = provenance.is_known() ? Json::parse(provenance_to_json(provenance)) : Json();
    to["results_provenance"] = from.value("provenance", Json());
    for (const char *key :
         {"name", "version", "plan", "world", "duration_ns", "repetitions", "units", "done", "complete", "checks",
          "violations", "runs_beyond_max_active", "factors", "effects", "runs"}) {
      to[key] = from.at(key);
    }
    to["metrics"] = kMetrics;
    to["points"] = Json::array();
    for (const Json &point : from.at("points")) to["points"].push_back(point_json(point));
    ExperimentDocument document;
    document.title = from.at("name").get<std::string>();
    document.json = to.dump(-1, ' ', false, Json::error_handler_t::replace);
    document.summary = fmt::format("{}: {} of {} runs, {} combinations, {} violations of the model", document.title,
                                   from.at("done").get<std::uint64_t>(), from.at("units").get<std::uint64_t>(),
                                   from.at("points").size(), from.at("violations").get<std::uint64_t>());
    return document;
  } catch (const nlohmann::json::exception &problem) {
    return mistake(fmt::format("cannot be read: {}", problem.what()));
  }
}

}  // namespace redag::report
