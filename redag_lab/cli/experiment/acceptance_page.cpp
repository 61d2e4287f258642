// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/experiment/acceptance_page.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/base/provenance.hpp"
#include "redag/base/text.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/report/page.hpp"

namespace redag::cli {
namespace {

using Json = nlohmann::ordered_json;
using report::html_escaped;

constexpr const char *kStyle =
    "body{font:16px/1.5 system-ui,sans-serif;max-width:1240px;margin:0 auto;padding:24px;color:#1b1f24;background:#fff}"
    "table{border-collapse:collapse;font-size:.84rem;font-variant-numeric:tabular-nums}"
    "th,td{text-align:right;padding:4px 8px;border-bottom:1px solid #d5dae0}th{color:#59636e}"
    "svg{max-width:100%;height:auto}pre{overflow-x:auto}.bad{color:#c4232b}";

std::string row_of(const std::vector<std::string> &cells, const char *tag) {
  std::string text = "<tr>";
  for (const std::string &cell : cells) text += fmt::format("<{0}>{1}</{0}>", tag, html_escaped(cell));
  return text + "</tr>\n";
}

std::string figures(const experiment::Acceptance &acceptance, const experiment::AcceptanceResults &results) {
  std::vector<std::string> heads = {"dags", "workers", "deadlines", "preemption", "utilization", "sets"};
  for (const std::string &method : acceptance.plan().methods) heads.push_back(method);
  std::string text = "<table><thead>" + row_of(heads, "th") + "</thead><tbody>\n";
  for (const experiment::AcceptanceRow &row : results.rows) {
    std::vector<std::string> cells = {std::to_string(row.point.dags),
                                      std::to_string(row.point.workers),
                                      to_string(row.point.deadlines),
                                      to_string(row.point.preemption),
                                      fmt::format("{}", row.point.utilization / double{experiment::kMillion}),
                                      format_count(row.sets)};
    for (const experiment::AcceptanceCell &cell : row.cells) {
      const bool none = row.sets == 0 || cell.not_applicable == row.sets;
      cells.push_back(none ? "-" : format_percent(static_cast<double>(cell.accepted) / static_cast<double>(row.sets)));
    }
    text += row_of(cells, "td");
  }
  return text + "</tbody></table>\n";
}

// A text of a run's record; empty if there is none. The records of killed runs and of other versions lack some.
std::string text_at(const Json &json, const char *key) {
  if (!json.is_object() || !json.contains(key)) return "";
  return json[key].is_string() ? json[key].get<std::string>() : json[key].dump();
}

// A begin and the end after it, if there is one, are one row.
std::string origin(const std::vector<std::string> &runs) {
  std::string text =
      "<table><thead>" +
      row_of({"begin", "shard", "host", "Slurm job", "version", "ranks", "jobs", "to do", "done", "time"}, "th") +
      "</thead><tbody>\n";
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Json begin = Json::parse(runs[i], nullptr, false);
    if (text_at(begin, "event") != "begin") continue;
    const Json next = i + 1 < runs.size() ? Json::parse(runs[i + 1], nullptr, false) : Json();
    const bool ended = text_at(next, "event") == "end";
    const bool timed = ended && next.contains("elapsed_ns") && next["elapsed_ns"].is_number_integer();
    const Json &provenance = begin.contains("provenance") ? begin["provenance"] : begin;
    text += row_of(
        {text_at(begin, "utc"), text_at(begin, "shard"), text_at(provenance, "host"), text_at(begin, "slurm_job"),
         text_at(begin, "version"), text_at(begin, "ranks"), text_at(begin, "jobs"), text_at(begin, "units"),
         ended ? text_at(next, "units") : "killed", timed ? humanize_duration(next["elapsed_ns"].get<Duration>()) : ""},
        "td");
  }
  return text + "</tbody></table>\n";
}

}  // namespace

std::string acceptance_page(const experiment::Acceptance &acceptance, const experiment::AcceptanceResults &results,
                            const std::vector<std::string> &runs) {
  const std::string name = html_escaped(acceptance.plan().name);
  std::string text = fmt::format(
      "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><title>{0} - ReDAG-RT report</title>\n"
      "<meta name='viewport' content='width=device-width'>\n"
      "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
      "<style>{1}</style></head><body>\n<h1>{0}</h1>\n<p>{2} of {3} workloads are done.</p>\n",
      name, kStyle, format_count(results.done), format_count(results.units));
  if (!results.violations.empty()) {
    text += fmt::format("<p class='bad'>{} of them refute a bound: unit {} is the first.</p>\n",
                        format_count(results.violations.size()), results.violations.front().unit);
  }
  text += to_svg(acceptance, results);
  text += "<h2>Share of workloads accepted</h2>\n" + figures(acceptance, results);
  text += "<h2>Where the units come from</h2>\n" + origin(runs);
  text += "<h2>Plan</h2>\n<pre>" + html_escaped(to_yaml(acceptance.plan())) + "</pre>\n";
  text += fmt::format("<p>{}</p>\n</body></html>\n", html_escaped(provenance_to_json(current_provenance())));
  return text;
}

}  // namespace redag::cli
