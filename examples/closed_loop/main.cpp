// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Unstable plants under feedback that shares its workers with perception and planning. The program shows how an
// executor's misses affect a robot. README.md beside this file explains it.
//
//     example_closed_loop --seeds 10 --out results/closed_loop        virtual time: the same everywhere
//     example_closed_loop --threads --executors redag,mte             on this machine
//     example_closed_loop --threads --stress '--cpu 2 --cache 1'      with stress-ng beside it
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>

#include "disturbance.hpp"
#include "experiment.hpp"
#include "pictures.hpp"
#include "redag/base/text.hpp"
#include "redag/loader/workload_yaml.hpp"

using namespace closed_loop;
using redag::kMillisecond;
using redag::kSecond;

namespace {

constexpr Duration kSnapshots = 10 * kMillisecond;
constexpr Duration kMovieFrame = 40 * kMillisecond;

struct Arguments {
  std::string workload = REDAG_SOURCE_DIR "/examples/closed_loop/robot.yaml";
  std::vector<std::string> executors = {"alone", "redag", "redag-none", "mte", "ste"};
  bool threads = false;
  std::uint32_t seeds = 3;
  std::uint64_t seed = 1;
  double seconds = 20;
  double movie = 0;  // seconds
  std::string out;
  std::string stress;
};

// The first Ctrl-C ends the run and the programs started beside it. The second ends the process.
std::atomic<bool> interrupted{false};

void watch_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted.store(true); };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void write(const std::filesystem::path &path, const std::string &text) {
  std::ofstream file(path);
  file << text;
  file.flush();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

struct Row {
  std::string executor;
  std::string mode;
  std::uint64_t seed = 0;
  RunOutcome outcome;
};

std::string results_csv(const std::vector<Row> &rows, bool threads) {
  std::string text = "world,executor,mode,seed,plant,cost,falls,jobs,missed,longest_gap_ns,other_jobs,other_missed\n";
  for (const Row &row : rows) {
    for (const PlantResult &plant : row.outcome.plants) {
      text += fmt::format("{},{},{},{},{},{:.9g},{},{},{},{},{},{}\n", threads ? "threads" : "virtual", row.executor,
                          row.mode, row.seed, plant.plant, plant.cost, plant.falls, plant.jobs, plant.missed,
                          plant.longest_gap, row.outcome.other_jobs, row.outcome.other_missed);
    }
  }
  return text;
}

std::string states_csv(const std::vector<Recorded> &runs) {
  std::string text = "executor,plant,time_ns,position_m,height_m,angle_rad,down\n";
  for (const Recorded &run : runs) {
    for (const PlantResult &plant : run.plants) {
      for (const Snapshot &s : plant.snapshots) {
        text += fmt::format("{},{},{},{:.6g},{:.6g},{:.6g},{}\n", run.executor, plant.plant, s.time, s.position,
                            s.height, s.angle, s.down ? 1 : 0);
      }
    }
  }
  return text;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

// Prints a line for each executor and plant, over all seeds.
void print(const std::vector<Row> &rows, const std::vector<std::string> &executors) {
  fmt::print("{:<18} {:<10} {:>6} {:>10} {:>22} {:>9} {:>12}\n", "executor", "plant", "falls", "cost",
             "(least..largest)", "missed", "longest gap");
  for (const std::string &executor : executors) {
    std::uint32_t falls_of_all = 0;
    for (const PlantSpec &spec : plants()) {
      std::vector<double> costs;
      std::uint32_t falls = 0;
      std::uint64_t jobs = 0;
      std::uint64_t missed = 0;
      Duration gap = 0;
      for (const Row &row : rows) {
        if (row.executor != executor) continue;
        for (const PlantResult &plant : row.outcome.plants) {
          if (plant.plant != spec.name) continue;
          costs.push_back(plant.cost);
          falls += plant.falls;
          jobs += plant.jobs;
          missed += plant.missed;
          gap = std::max(gap, plant.longest_gap);
        }
      }
      falls_of_all += falls;
      fmt::print("{:<18} {:<10} {:>6} {:>10.4g} {:>22} {:>9} {:>12}\n", executor, spec.name, falls, median(costs),
                 fmt::format("({:.4g}..{:.4g})", *std::min_element(costs.begin(), costs.end()),
                             *std::max_element(costs.begin(), costs.end())),
                 redag::format_percent(jobs == 0 ? 0 : static_cast<double>(missed) / static_cast<double>(jobs)),
                 redag::humanize_duration(gap));
    }
    std::uint64_t others = 0;
    std::uint64_t others_missed = 0;
    for (const Row &row : rows) {
      if (row.executor != executor) continue;
      others += row.outcome.other_jobs;
      others_missed += row.outcome.other_missed;
    }
    fmt::print("{:<18} falls: {}; perception and planning: {} of {} jobs missed\n\n", executor, falls_of_all,
               others_missed, others);
  }
}

// Returns the instant of a first fall. Among the executors under which a plant fell, it takes the one with the fewest
// falls: there the executors can be compared.
Time fall_of(const std::vector<Recorded> &runs, Time end) {
  Time fall = end / 2;
  std::uint32_t fewest = std::numeric_limits<std::uint32_t>::max();
  for (const Recorded &run : runs) {
    std::uint32_t falls = 0;
    Time first = end;
    for (const PlantResult &plant : run.plants) {
      falls += plant.falls;
      const auto down = std::find_if(plant.snapshots.begin(), plant.snapshots.end(),
                                     [](const Snapshot &snapshot) { return snapshot.down; });
      if (down != plant.snapshots.end()) first = std::min(first, down->time);
    }
    if (falls == 0 || falls >= fewest) continue;
    fewest = falls;
    fall = first;
  }
  return fall;
}

std::vector<Time> moments(Time fall) {
  std::vector<Time> times;
  for (const int before : {200, 80, 40, 0}) times.push_back(std::max<Time>(0, fall - before * kMillisecond));
  return times;
}

// Returns the instants of a movie with the fall in its middle.
std::vector<Time> instants(Time fall, Duration length) {
  std::vector<Time> times;
  const Time end = fall + length / 2;
  for (Time time = std::max<Time>(0, end - length); time < end; time += kMovieFrame) times.push_back(time);
  return times;
}

int run(const Arguments &arguments) {
  const auto file = redag::load_workload(arguments.workload);
  if (!file) {
    fmt::print(stderr, "{}\n", to_string(file.error()));
    return 2;
  }
  std::optional<Disturbance> disturbance;
  if (!arguments.stress.empty()) {
    if (!arguments.threads)
      throw std::runtime_error("--stress needs --threads: runs in virtual time cannot be disturbed");
    disturbance.emplace(stress_ng(arguments.stress));
  }
  RunSetup setup;
  setup.stop = &interrupted;
  setup.duration = static_cast<Duration>(arguments.seconds * kSecond);
  std::vector<Row> rows;
  std::vector<Recorded> recorded;
  for (std::uint32_t s = 0; s < arguments.seeds; ++s) {
    for (const std::string &name : arguments.executors) {
      const ExecutorChoice choice = executor_choice(name);
      setup.seed = arguments.seed + s;
      setup.snapshots_every = s == 0 ? kSnapshots : 0;
      fmt::print(stderr, "{} with seed {}\n", name, setup.seed);
      RunOutcome outcome = arguments.threads ? run_on_threads(file->workload, choice, setup)
                                             : run_in_virtual_time(file->workload, choice, setup);
      if (interrupted) throw std::runtime_error("interrupted");
      if (disturbance) disturbance->expect_running();
      if (s == 0) recorded.push_back({name, outcome.plants});
      rows.push_back({name, outcome.mode, setup.seed, std::move(outcome)});
    }
  }
  print(rows, arguments.executors);
  if (arguments.out.empty()) return 0;
  const std::filesystem::path out(arguments.out);
  std::filesystem::create_directories(out);
  write(out / "results.csv", results_csv(rows, arguments.threads));
  write(out / "states.csv", states_csv(recorded));
  write(out / "trajectories.svg",
        trajectories_svg(
            recorded, "Five unstable plants under feedback that shares two workers with perception and planning",
            fmt::format("{}, seed {}, {:g} s; the same pushes and the same jobs for every executor",
                        arguments.threads ? "threads" : "virtual time", arguments.seed, arguments.seconds)));
  if (can_render()) {
    const Time fall = fall_of(recorded, setup.duration);
    write_frames(out / "frames.png", recorded, moments(fall));
    if (arguments.movie > 0) {
      std::filesystem::create_directories(out / "movie");
      write_movie(out / "movie", recorded, instants(fall, static_cast<Duration>(arguments.movie * kSecond)));
    }
  } else {
    fmt::print(stderr, "no frames: built without libosmesa6-dev and libpng-dev\n");
  }
  fmt::print("wrote {}: results.csv, states.csv, trajectories.svg{}{}\n", out.string(),
             can_render() ? ", frames.png" : "", can_render() && arguments.movie > 0 ? ", movie/" : "");
  return 0;
}

}  // namespace

int main(int argc, char **argv) {
  Arguments arguments;
  CLI::App app("Unstable plants under feedback that shares its workers: effects of an executor's misses on a robot");
  app.add_option("workload", arguments.workload,
                 "Workload (YAML), with DAGs named after the plants and tasks sense and control")
      ->capture_default_str();
  app.add_option("--executors", arguments.executors,
                 "Executors: alone, redag, redag-cooperative, redag-none, mte, ste, static, events, cbg; with -fifo "
                 "(mte-fifo, ...) on SCHED_FIFO threads")
      ->delimiter(',')
      ->capture_default_str();
  app.add_flag("--threads", arguments.threads, "Run on threads of this machine in real time, instead of virtual time");
  app.add_option("--stress", arguments.stress,
                 "With --threads, run stress-ng with these arguments meanwhile, such as '--cpu 2 --cache 1'");
  app.add_option("--seeds", arguments.seeds, "Number of runs, with seeds SEED, SEED+1, ...")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option("--seed", arguments.seed, "Seed of pushes and execution times")->capture_default_str();
  app.add_option("--seconds", arguments.seconds, "Length of a run")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  app.add_option("--movie", arguments.movie,
                 "Also draw this many seconds around a fall, 25 frames a second, to OUT/movie")
      ->check(CLI::Range(0.1, 60.0));
  app.add_option("--out", arguments.out, "Folder for results.csv, states.csv, trajectories.svg and frames.png");
  CLI11_PARSE(app, argc, argv);
  watch_signals();
  try {
    return run(arguments);
  } catch (const std::exception &error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
}
