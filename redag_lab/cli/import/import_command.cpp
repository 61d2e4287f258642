// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/loader/provenance.hpp"
#include "redag/loader/validate.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/cli/import/verdict_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/import/ctf_reader.hpp"
#include "redag_lab/import/model.hpp"
#include "redag_lab/import/self_check.hpp"
#include "redag_lab/import/verdict.hpp"

namespace redag::cli {
namespace {

constexpr const char *kEveryProcess = "all";

struct ImportOptions {
  std::string trace;
  std::string file;
  std::string process;
  bool check = false;
  bool verdict = false;
  std::uint32_t workers = 0;  // of the verdict, beside the recorded ones; 0: half of these
  bool json = false;
};

// Returns the process to import, or with "all" every one that ran callbacks. Otherwise prints which there are.
std::vector<std::uint32_t> choose_processes(const lab::Recording &recording, const std::string &wanted,
                                            Console &console) {
  std::vector<std::uint32_t> chosen;
  std::vector<std::string> names;
  for (const auto &[process, record] : recording.processes()) {
    if (record.runs == 0) continue;
    names.push_back(fmt::format("{} ({}, {})", process, printable(record.program), plural(record.runs, "run")));
    if (wanted.empty() || wanted == kEveryProcess || wanted == std::to_string(process) || wanted == record.program) {
      chosen.push_back(process);
    }
  }
  if (chosen.size() == 1 || wanted == kEveryProcess) return chosen;
  if (names.empty()) {
    console.error("the recording has no run of a callback", recording.events() == 0
                                                                ? "record the events 'ros2:*', as `ros2 trace` does"
                                                                : "let the nodes run while it records");
  } else if (chosen.empty()) {
    console.error(fmt::format("{} ran no callback; these processes did: {}", in_quotes(wanted), join(names)));
  } else {
    console.error("several processes ran callbacks: " + join(names),
                  "name one of them behind the recording, or 'all' for a robot file");
  }
  return {};
}

// What the file should not hide.
std::vector<std::string> gaps_of(const lab::ReadTrace &read) {
  std::vector<std::string> gaps;
  if (read.lost > 0 || read.lost_more) {
    gaps.push_back(fmt::format("unknown: {} that the tracer lost{}. Edges, rates and longest executions can be wrong.",
                               read.lost > 0 ? plural(read.lost, "event") : std::string("events"),
                               read.lost_more && read.lost > 0 ? ", and more" : ""));
  }
  if (read.stopped) gaps.emplace_back("unknown: the rest of the recording, since reading was interrupted.");
  return gaps;
}

Result<lab::WhatIf> judge(const lab::ImportedWorkload &imported, const lab::SelfCheck &check,
                          std::uint32_t other_workers, Console &console) {
  const InterruptGuard guard;
  Progress progress(console);
  progress.set_label("judging");
  return lab::judge(imported, check,
                    {.other_workers = other_workers, .stop = &InterruptGuard::flag(), .progress = [&](double done) {
                       if (progress.due()) progress.draw(done, "simulating" + progress.left(done));
                     }});
}

// Prints whether the simulator does what the robot did, and with `verdict` what other executors would do. Returns the
// exit status.
int check_model(const lab::ImportedWorkload &imported, const ImportOptions &options, Console &console) {
  const Result<lab::SelfCheck> check = lab::check_against_recording(imported);
  if (!ok(check, console)) return kExitBad;
  if (!options.verdict) {
    console.say(describe(*check, console.out_traits()));
    return check->is_reproduced() ? kExitOk : kExitNo;
  }
  const std::uint32_t recorded = imported.workload.platform.workers;
  const std::uint32_t other = options.workers > 0 ? options.workers : recorded == 1 ? 2 : (recorded + 1) / 2;
  const Result<lab::WhatIf> verdict = judge(imported, *check, other, console);
  if (!ok(verdict, console)) return kExitBad;
  if (options.json) {
    console.print(to_text(to_json(*verdict, imported.workload)));
  } else {
    console.say(describe(*verdict, imported.workload, console.out_traits()));
  }
  const bool is_fine = verdict->judged() > 0 && check->is_reproduced() && verdict->outcomes.front().missed == 0;
  return is_fine ? kExitOk : kExitNo;
}

Result<lab::ReadTrace> read_into(lab::Recording &recording, const std::string &trace, Console &console) {
  const InterruptGuard guard;
  Progress progress(console);
  progress.set_label("reading");
  Result<lab::ReadTrace> read = lab::read_ros_trace(
      trace, [&](const lab::RosEvent &event) { recording.add(event); },
      [&](double done) {
        if (progress.due()) progress.draw(done, plural(recording.events(), "event") + progress.left(done));
        return !InterruptGuard::interrupted();
      });
  progress.clear();
  return read;
}

int import_trace(const ImportOptions &options, Console &console) {
  if (options.process == kEveryProcess && (options.check || options.verdict)) {
    console.error("--check and --verdict are for one executor: name one process, not 'all'");
    return kExitBad;
  }
  if (!options.file.empty() && !ok(check_output(options.file), console)) return kExitBad;
  lab::Recording recording;
  const Result<lab::ReadTrace> read = read_into(recording, options.trace, console);
  if (!ok(read, console)) return kExitBad;
  const bool is_robot = options.process == kEveryProcess;
  std::vector<lab::ImportedWorkload> imported;
  for (const std::uint32_t process : choose_processes(recording, options.process, console)) {
    Result<lab::ImportedWorkload> one = lab::import_workload(recording, process);
    if (one) {
      imported.push_back(*std::move(one));
    } else if (is_robot) {
      console.warn(fmt::format("process {} is left out: {}", process, one.error().front().message));
    } else {
      console.note(one.error());
    }
  }
  if (imported.empty()) return kExitBad;
  for (const std::string &gap : gaps_of(*read)) {
    console.warn(gap);
    for (lab::ImportedWorkload &one : imported) one.remarks.insert(one.remarks.begin(), gap);
  }
  const lab::ImportedWorkload &first = imported.front();
  const std::string text =
      provenance_to_comment(current_provenance()) +
      (is_robot ? lab::to_robot_yaml(imported, static_cast<std::uint32_t>(read->cpus)) : lab::to_yaml(first));
  if (options.file.empty() && !options.check && !options.verdict) {
    console.print(text);
    return kExitOk;
  }
  const auto say = [&](const std::string &line) { options.json ? console.note(line) : console.say(line); };
  if (!is_robot) {
    for (const std::string &remark : first.remarks) say(remark + "\n");
  }
  if (!options.file.empty()) {
    if (!ok(write_text(options.file, text), console)) return kExitBad;
    std::size_t dags = 0;
    std::size_t tasks = 0;
    std::size_t left_out = 0;
    for (const lab::ImportedWorkload &one : imported) {
      dags += one.workload.dags.size();
      tasks += one.workload.task_count();
      left_out += one.left_out.size();
    }
    say(fmt::format("wrote {}: {}, {}, {} left out; its comments say what is assumed, and what is unknown\n",
                    options.file, plural(dags, "DAG"), plural(tasks, "task"), plural(left_out, "callback")));
  }
  return options.check || options.verdict ? check_model(first, options, console) : kExitOk;
}

}  // namespace

Action add_import(CLI::App &app) {
  auto options = std::make_shared<ImportOptions>();
  app.add_option("TRACE", options->trace, "Folder that `ros2 trace` or LTTng recorded to: the Common Trace Format")
      ->required();
  app.add_option("PROCESS", options->process,
                 "Its number or program, if several processes ran callbacks; all: a robot file of them");
  app.add_option("-o,--output", options->file, "File to write (default: standard output)")->type_name("FILE");
  app.add_flag("--check", options->check,
               "Simulate the executor that was recorded, and exit with status 1 unless its responses are as recorded");
  CLI::Option *verdict = app.add_flag(
      "--verdict", options->verdict,
      "Say what each executor would do, which deadlines are shown to hold, and what to change; exit with status 1 if "
      "the recorded executor misses deadlines, or its model differs");
  add_count(app, "--workers", options->workers, {1, kMaxWorkers},
            "Threads for a second verdict (default: half the recorded ones)")
      ->default_str("")
      ->needs(verdict);
  app.add_flag("--json", options->json, "Print the verdict as JSON")->needs(verdict);
  return [options](Console &console) { return import_trace(*options, console); };
}

}  // namespace redag::cli
