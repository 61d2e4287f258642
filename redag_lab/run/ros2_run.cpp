// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/ros2_run.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"

extern char **environ;  // NOLINT(readability-redundant-declaration): POSIX has it in no header

namespace redag::lab {
namespace {

namespace fs = std::filesystem;

/// A temporary folder for one run, removed by the destructor.
class Scratch {
 public:
  Scratch() : path_((fs::temp_directory_path() / "redag-ros2.XXXXXX").string()) {
    made_ = ::mkdtemp(path_.data()) != nullptr;
  }
  Scratch(const Scratch &) = delete;
  Scratch &operator=(const Scratch &) = delete;
  ~Scratch() {
    std::error_code ignored;
    if (made_) fs::remove_all(path_, ignored);
  }
  [[nodiscard]] bool made() const { return made_; }
  [[nodiscard]] std::string file(const char *name) const { return path_ + "/" + name; }

 private:
  std::string path_;
  bool made_ = false;
};

// Starts `words` with its output in `log`, and waits. Returns the wait status, or a negative errno.
int run_program(std::vector<std::string> words, const std::string &log, const std::atomic<bool> &stop) {
  std::vector<char *> argv;
  argv.reserve(words.size() + 1);
  for (std::string &word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, argv.front(), &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -error;
  int status = 0;
  bool told = false;
  while (::waitpid(child, &status, WNOHANG) == 0) {
    if (stop.load() && !told) {
      ::kill(child, SIGINT);  // Ctrl-C in a terminal has already reached it
      told = true;
    }
    ::usleep(10'000);
  }
  return status;
}

// Returns the program's last error message, or else its last line.
std::string last_words(const std::string &log) {
  const Result<std::string> text = read_file(log);
  if (!text || text->empty()) return "nothing";
  std::size_t at = text->rfind("error:");
  if (at == std::string::npos) at = text->find_last_of('\n', text->size() - 2) + 1;
  return text->substr(at, text->find('\n', at) - at);
}

}  // namespace

const std::vector<std::string> &ros2_executors() {
  static const std::vector<std::string> kNames = {"redag",  "redag-none", "redag-cooperative", "redag-os", "mte", "ste",
                                                  "static", "events"};
  return kNames;
}

Result<experiment::FinishedRun> run_in_ros2(const experiment::PlannedRun &planned, const std::string &program,
                                            const std::atomic<bool> &stop) {
  const Scratch scratch;
  if (!scratch.made()) return make_error(fmt::format("cannot create a folder for a run: {}", std::strerror(errno)));
  if (Result<void> saved = save_workload(planned.workload, scratch.file("workload.yaml")); !saved) {
    return tl::unexpected<Diagnostics>(std::move(saved.error()));
  }
  std::vector<std::string> words = {program};
  if (program.empty()) words = {"ros2", "run", "redag_rclcpp_lab", "run_workload"};
  const std::string out = scratch.file("out");
  for (std::string word :
       {scratch.file("workload.yaml"), "--executor=" + planned.executor,
        fmt::format("--duration={}ns", planned.duration), fmt::format("--warm-up={}ns", planned.warm_up),
        fmt::format("--seed={}", planned.seed), "--out=" + out}) {
    words.push_back(std::move(word));
  }
  const std::string log = scratch.file("log");
  const std::string name = program.empty() ? "ros2 run redag_rclcpp_lab run_workload" : program;
  const int status = run_program(words, log, stop);
  if (status < 0) {
    return make_error(fmt::format("cannot start '{}': {}", name, std::strerror(-status)),
                      "source the workspace with redag_rclcpp_lab, or name the program with --run-workload");
  }
  if (stop.load()) return make_error("interrupted");
  // Status 1 means that the trace breaks a rule, which is checked below.
  if (!WIFEXITED(status) || WEXITSTATUS(status) > 1) {
    return make_error(fmt::format("'{}' failed with this message: {}", name, last_words(log)));
  }
  Result<trace::Trace> trace = trace::read_trace(fmt::format("{}/{}", out, trace::kEventsFile));
  if (!trace) return tl::unexpected<Diagnostics>(std::move(trace.error()));
  experiment::FinishedRun run;
  run.trace = std::move(*trace);
  run.summary = metrics::summarize(run.trace);
  run.check = metrics::check_trace(run.trace, metrics::rules_for(run.trace.info));
  return run;
}

}  // namespace redag::lab
