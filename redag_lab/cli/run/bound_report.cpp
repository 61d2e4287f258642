// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/bound_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using metrics::Broken;

const char *name_of(Broken broken) {
  switch (broken) {
    case Broken::Wcet: return "wcet";
    case Broken::Release: return "release";
    case Broken::Platform: return "platform";
    case Broken::Nothing: break;
  }
  return "unknown";
}

}  // namespace

std::string describe(const lab::BoundCheck &check, std::size_t tasks, const StreamTraits &terminal) {
  std::string text = fmt::format("bounds: {} of {} tasks have a bound", check.bounded, tasks);
  text += check.absent.empty() ? "" : fmt::format(" ({})", check.absent);
  text += check.assumptions.is_calibrated ? ", with the machine's overheads charged" : "";
  if (check.remarks.empty()) {
    text += fmt::format("{}, {}", check.bounded > 0 ? "; no response time was above its bound" : "",
                        tinted("no execution time was above its wcet", Tint::Good, terminal.colour));
  } else if (!check.assumptions.has_alarms()) {
    text += "; " + tinted("no alarm", Tint::Good, terminal.colour);
  }
  text += "\n";
  for (const metrics::Remark &remark : check.remarks) {
    text += fmt::format(
        "  {}: {}\n",
        remark.is_alarm ? tinted("alarm", Tint::Bad, terminal.colour) : tinted("note", Tint::Faint, terminal.colour),
        remark.text);
  }
  if (check.bounded > 0 && !check.assumptions.is_calibrated) {
    text += fmt::format("  {}\n", metrics::not_calibrated_hint());
  }
  return text;
}

Json to_json(const lab::BoundCheck &check) {
  Json tasks = Json::array();
  for (const metrics::TaskCheck &task : check.assumptions.tasks) {
    const std::size_t t = task.task.value;
    const metrics::ResponseCheck &response = task.response;
    const metrics::ExecutionCheck &execution = task.execution;
    const bool is_broken = response.exceeded > 0;
    const bool has_amount = is_broken && response.broken != Broken::Nothing;
    tasks.push_back(Json{{"name", check.names[t]},
                         {"bound_ns", response.bound > 0 ? Json(response.bound) : Json()},
                         {"method", response.bound > 0 ? Json(check.methods[t]) : Json()},
                         {"exceeded", response.exceeded},
                         {"worst_ns", is_broken ? Json(response.worst) : Json()},
                         {"cause", is_broken ? Json(name_of(response.broken)) : Json()},
                         {"cause_ns", has_amount ? Json(response.amount) : Json()},
                         {"alarm", response.is_alarm},
                         {"wcet_ns", check.wcets[t]},
                         {"processor_max_ns", execution.jobs > 0 ? Json(execution.longest) : Json()},
                         {"above_wcet", execution.above},
                         {"wcet_exceeded", execution.is_exceeded}});
  }
  Json remarks = Json::array();
  for (const metrics::Remark &remark : check.remarks) {
    remarks.push_back(Json{{"alarm", remark.is_alarm}, {"text", remark.text}});
  }
  return Json{{"bounded", check.bounded},
              {"absent", check.absent},
              {"calibrated", check.assumptions.is_calibrated},
              {"alarms", std::count_if(check.remarks.begin(), check.remarks.end(),
                                       [](const metrics::Remark &remark) { return remark.is_alarm; })},
              {"remarks", std::move(remarks)},
              {"tasks", std::move(tasks)}};
}

}  // namespace redag::cli
