// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>

#include "redag/base/text.hpp"
#include "redag/base/words.hpp"
#include "redag/loader/provenance.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/import/ctf_reader.hpp"
#include "redag_lab/import/model.hpp"
#include "redag_lab/import/self_check.hpp"

namespace redag::cli {
namespace {

struct ImportOptions {
  std::string trace;
  std::string file;
  std::string process;
  bool check = false;
};

// Returns the one process to import. Otherwise prints which there are.
std::optional<std::uint32_t> choose_process(const lab::Recording &recording, const std::string &wanted,
                                            Console &console) {
  std::vector<std::uint32_t> chosen;
  std::vector<std::string> names;
  for (const auto &[process, record] : recording.processes()) {
    if (record.runs == 0) continue;
    names.push_back(fmt::format("{} ({}, {})", process, printable(record.program), plural(record.runs, "run")));
    if (wanted.empty() || wanted == std::to_string(process) || wanted == record.program) chosen.push_back(process);
  }
  if (chosen.size() == 1) return chosen.front();
  if (names.empty()) {
    console.error("the recording has no run of a callback", recording.events() == 0
                                                                ? "record the events 'ros2:*', as `ros2 trace` does"
                                                                : "let the nodes run while it records");
  } else if (chosen.empty()) {
    console.error(fmt::format("{} ran no callback; these processes did: {}", in_quotes(wanted), join(names)));
  } else {
    console.error("several processes ran callbacks: " + join(names), "name one of them behind the recording");
  }
  return std::nullopt;
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

// Prints whether the simulator does what the robot did. Returns the exit status.
int check_model(const lab::ImportedWorkload &imported, Console &console) {
  const Result<lab::SelfCheck> check = lab::check_against_recording(imported);
  if (!check) {
    console.note(check.error());
    return kExitBad;
  }
  Table table({{.title = "response of"},
               {.title = "p50"},
               {.title = "simulated"},
               {.title = "p99"},
               {.title = "simulated"},
               {.title = ""}});
  std::size_t wrong = 0;
  for (const lab::ReproducedTask &task : check->tasks) {
    if (!task.is_reproduced()) ++wrong;
    table.add({{task.name},
               {humanize_duration(task.recorded.p50)},
               {humanize_duration(task.simulated.p50)},
               {humanize_duration(task.recorded.p99)},
               {humanize_duration(task.simulated.p99)},
               {task.is_reproduced() ? "" : "differs", Tint::Bad}});
  }
  console.say(table.render(console.out_traits().width, console.out_traits().colour));
  console.say(fmt::format(
      "The model of {} reproduces {} of {} (p50 within 10 %, p99 within 25 %, or 100us). Trust no comparison of the "
      "others.\n",
      check->executor, check->tasks.size() - wrong, plural(check->tasks.size(), "recorded response")));
  if (!check->unknown.empty()) {
    console.say(fmt::format("unknown: when jobs of {} were released\n", join_first(check->unknown, 5)));
  }
  return wrong == 0 ? kExitOk : kExitNo;
}

int import_trace(const ImportOptions &options, Console &console) {
  if (!options.file.empty()) {
    if (const Result<void> possible = check_output(options.file); !possible) {
      console.note(possible.error());
      return kExitBad;
    }
  }
  lab::Recording recording;
  const InterruptGuard guard;
  Progress progress(console);
  progress.set_label("reading");
  const Result<lab::ReadTrace> read = lab::read_ros_trace(
      options.trace, [&](const lab::RosEvent &event) { recording.add(event); },
      [&](double done) {
        if (progress.due()) progress.draw(done, plural(recording.events(), "event") + progress.left(done));
        return !InterruptGuard::interrupted();
      });
  progress.clear();
  if (!read) {
    console.note(read.error());
    return kExitBad;
  }
  const std::optional<std::uint32_t> process = choose_process(recording, options.process, console);
  if (!process) return kExitBad;
  Result<lab::ImportedWorkload> imported = lab::import_workload(recording, *process);
  if (!imported) {
    console.note(imported.error());
    return kExitBad;
  }
  for (const std::string &gap : gaps_of(*read)) {
    console.warn(gap);
    imported->remarks.insert(imported->remarks.begin(), gap);
  }
  const std::string text = provenance_to_comment(current_provenance()) + lab::to_yaml(*imported);
  if (options.file.empty() && !options.check) {
    console.print(text);
    return kExitOk;
  }
  for (const std::string &remark : imported->remarks) console.say(remark + "\n");
  if (!options.file.empty()) {
    if (const Result<void> written = write_text(options.file, text); !written) {
      console.note(written.error());
      return kExitBad;
    }
    console.say(fmt::format("wrote {}: {}, {}, {} left out; its comments say what is assumed, and what is unknown\n",
                            options.file, plural(imported->workload.dags.size(), "DAG"),
                            plural(imported->workload.task_count(), "task"),
                            plural(imported->left_out.size(), "callback")));
  }
  return options.check ? check_model(*imported, console) : kExitOk;
}

}  // namespace

Action add_import(CLI::App &app) {
  auto options = std::make_shared<ImportOptions>();
  app.add_option("TRACE", options->trace, "Folder that `ros2 trace` or LTTng recorded to: the Common Trace Format")
      ->required();
  app.add_option("PROCESS", options->process, "Its number or program, if several processes ran callbacks");
  app.add_option("-o,--output", options->file, "File to write (default: standard output)")->type_name("FILE");
  app.add_flag("--check", options->check,
               "Simulate the executor that was recorded, and exit with status 1 unless its responses are as recorded");
  return [options](Console &console) { return import_trace(*options, console); };
}

}  // namespace redag::cli
