// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "redag/loader/hyperperiod_warning.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_analysis/text/tint.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/json.hpp"

namespace redag::cli {
namespace {

struct ValidateOptions {
  std::vector<std::string> files;
  bool strict = false;
  bool json = false;
};

struct Facts {
  std::size_t dags = 0;
  std::size_t tasks = 0;
  std::size_t edges = 0;
  std::size_t without_wcet = 0;  // callbacks whose wcet is not measured yet
  double utilization = 0;
  std::uint32_t workers = 0;
  std::optional<Duration> hyperperiod;
};

Facts facts_of(const Workload &workload) {
  Facts facts;
  facts.dags = workload.dags.size();
  facts.tasks = workload.task_count();
  for (const TaskRef &ref : flatten(workload)) {
    facts.edges += ref.task->predecessors.size();
    if (ref.task->wcet == 0) ++facts.without_wcet;
  }
  facts.utilization = workload.utilization();
  facts.workers = workload.platform.workers;
  facts.hyperperiod = sim::hyperperiod(workload);
  return facts;
}

std::string describe(const Facts &facts) {
  const std::string unknown = facts.without_wcet == 0 ? "" : fmt::format(" ({} without wcet)", facts.without_wcet);
  return fmt::format("{}, {}{}, {}, utilization {:.3f} on {} ({:.1f} %), hyperperiod {}", plural(facts.dags, "DAG"),
                     plural(facts.tasks, "task"), unknown, plural(facts.edges, "edge"), facts.utilization,
                     plural(facts.workers, "worker"), 100 * facts.utilization / facts.workers,
                     hyperperiod_text(facts.hyperperiod));
}

Json facts_json(const std::string &name, const Facts &facts) {
  return Json{{"name", name},
              {"dags", facts.dags},
              {"tasks", facts.tasks},
              {"edges", facts.edges},
              {"without_wcet", facts.without_wcet},
              {"utilization", facts.utilization},
              {"workers", facts.workers},
              {"hyperperiod_ns", facts.hyperperiod ? Json(*facts.hyperperiod) : Json()}};
}

// What a robot file has besides the workload that it makes.
std::string describe(const robot::Robot &robot) {
  std::size_t cpus = 0;
  for (const robot::CpuSet &set : robot.cpu_sets) cpus += set.cpus.size();
  return fmt::format("robot of {} on {}, {} of threads: ", plural(robot.processes.size(), "process", "processes"),
                     plural(cpus, "processor"), plural(robot.threads.size(), "entry", "entries"));
}

int validate_files(const ValidateOptions &options, Console &console) {
  Json files = Json::array();
  bool all_ok = true;
  for (const std::string &file : options.files) {
    const Result<robot::Input> input = load_workload_or_robot(file, {.wcet_optional = true, .waits = true});
    const Diagnostics &found = input ? input->loaded.warnings : input.error();
    const bool is_ok = input.has_value() && (found.empty() || !options.strict);
    all_ok = all_ok && is_ok;
    if (options.json) {
      files.push_back(Json{{"file", file}, {"ok", is_ok}, {"diagnostics", diagnostics_json(found)}});
      if (input && input->robot) files.back()["robot"] = input->robot->name;
      if (input) files.back()["workload"] = facts_json(input->loaded.workload.name, facts_of(input->loaded.workload));
      continue;
    }
    console.note(found);
    if (is_ok) {
      const std::string verdict = tinted("ok", Tint::Good, console.out_traits().colour);
      console.say(fmt::format("{}: {}: {}{}\n", file, verdict, input->robot ? describe(*input->robot) : "",
                              describe(facts_of(input->loaded.workload))));
    } else if (input) {
      console.error(fmt::format("{}: {} not accepted by --strict", file, plural(found.size(), "warning")));
    }
  }
  if (options.json) console.print(to_text(Json{{"format", "redag.validate/1"}, {"ok", all_ok}, {"files", files}}));
  return all_ok ? kExitOk : kExitBad;
}

}  // namespace

Action add_validate(CLI::App &app) {
  auto options = std::make_shared<ValidateOptions>();
  app.add_option("FILE", options->files, "Files of workloads or robots (YAML); - reads standard input")
      ->type_name("WORKLOAD")
      ->required();
  app.add_flag("--strict", options->strict, "Treat warnings as errors");
  app.add_flag("--json", options->json, "Write the findings as one JSON document");
  return [options](Console &console) { return validate_files(*options, console); };
}

}  // namespace redag::cli
