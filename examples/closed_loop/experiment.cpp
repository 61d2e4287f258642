// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "experiment.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "loop.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/run/run_workload.hpp"

namespace closed_loop {
namespace {

using namespace redag;

Workload configured(const Workload &workload, const ExecutorChoice &choice) {
  Workload result = workload;
  if (choice.executor == "redag") result.platform.preemption = choice.preemption;
  if (!choice.alone) return result;
  const std::vector<PlantSpec> known = plants();
  const auto is_plant = [&](const Dag &dag) {
    return std::any_of(known.begin(), known.end(), [&](const PlantSpec &spec) { return spec.name == dag.name; });
  };
  result.dags.erase(
      std::remove_if(result.dags.begin(), result.dags.end(), [&](const Dag &dag) { return !is_plant(dag); }),
      result.dags.end());
  return result;
}

Snapshot snapshot(const Plant &plant) {
  return Snapshot{plant.time(), plant.position(), plant.height(), plant.angle(), plant.is_down()};
}

// Combines the jobs' figures from the trace with the plants' own figures.
RunOutcome outcome_of(const Workload &workload, const std::vector<JobEvent> &events, Time end, Loops &loops,
                      std::vector<std::vector<Snapshot>> snapshots) {
  RunOutcome outcome;
  const std::vector<PlantSpec> known = plants();
  for (std::size_t i = 0; i < known.size(); ++i) {
    PlantResult result;
    result.plant = known[i].name;
    loops.all()[i]->look(end, [&](const Plant &plant) {
      result.cost = plant.cost();
      result.falls = plant.falls();
    });
    result.snapshots = std::move(snapshots[i]);
    outcome.plants.push_back(std::move(result));
  }
  const std::vector<TaskRef> tasks = flatten(workload);
  std::vector<Time> last_actuation(known.size(), 0);
  std::vector<metrics::JobRecord> jobs = metrics::fold_jobs(workload, events);
  std::stable_sort(jobs.begin(), jobs.end(), [](const auto &a, const auto &b) { return a.finish < b.finish; });
  for (const metrics::JobRecord &job : jobs) {
    const std::string &dag = workload.dags[tasks[job.task.value].dag.value].name;
    const bool missed = metrics::miss_of(job, end) != metrics::Miss::None;
    const auto plant =
        std::find_if(known.begin(), known.end(), [&](const PlantSpec &spec) { return spec.name == dag; });
    if (plant == known.end()) {
      ++outcome.other_jobs;
      if (missed) ++outcome.other_missed;
      continue;
    }
    const auto index = static_cast<std::size_t>(plant - known.begin());
    PlantResult &result = outcome.plants[index];
    ++result.jobs;
    if (missed) ++result.missed;
    if (job.outcome != metrics::JobOutcome::Finished || tasks[job.task.value].task->name != "control") continue;
    result.longest_gap = std::max(result.longest_gap, job.finish - last_actuation[index]);
    last_actuation[index] = job.finish;
  }
  return outcome;
}

}  // namespace

std::vector<PlantSpec> plants() {
  using Kind = PlantSpec::Kind;
  return {{"pole_10cm", Kind::CartPole, 0.1, 1 * kMillisecond, 3.0},
          {"pole_20cm", Kind::CartPole, 0.2, 2 * kMillisecond, 2.2},
          {"pole_40cm", Kind::CartPole, 0.4, 2 * kMillisecond, 1.5},
          {"quadrotor", Kind::Quadrotor, 0.2, 4 * kMillisecond, 4.0},
          {"pole_80cm", Kind::CartPole, 0.8, 5 * kMillisecond, 1.0}};
}

ExecutorChoice executor_choice(const std::string &name) {
  std::vector<ExecutorChoice> choices = {{"alone", "redag", PreemptionMode::Auto, true, false},
                                         {"redag", "redag", PreemptionMode::Auto, false, false},
                                         {"redag-cooperative", "redag", PreemptionMode::Cooperative, false, false},
                                         {"redag-none", "redag", PreemptionMode::None, false, false}};
  for (const executors::ExecutorKind &kind : executors::all()) {
    const std::string peer(kind.name);
    if (kind.ours) continue;
    choices.push_back({peer, peer, PreemptionMode::None, false, false});
    choices.push_back({peer + "-fifo", peer, PreemptionMode::None, false, true});
  }
  std::string known;
  for (const ExecutorChoice &choice : choices) {
    if (choice.name == name) return choice;
    known += (known.empty() ? "" : ", ") + choice.name;
  }
  throw std::runtime_error("there is no executor '" + name + "' (one of " + known + ")");
}

RunOutcome run_in_virtual_time(const Workload &workload, const ExecutorChoice &choice, const RunSetup &setup) {
  const Workload run = configured(workload, choice);
  Loops loops(plants(), setup.seed);
  const std::vector<TaskRole> roles = loops.roles(run);
  std::vector<std::vector<Snapshot>> snapshots(loops.all().size());
  Time next_snapshot = setup.snapshots_every > 0 ? 0 : kNever;
  std::vector<JobEvent> events;
  const auto record_until = [&](Time now) {
    for (; next_snapshot <= now; next_snapshot += setup.snapshots_every) {
      for (std::size_t i = 0; i < snapshots.size(); ++i) {
        loops.all()[i]->look(next_snapshot, [&](const Plant &plant) { snapshots[i].push_back(snapshot(plant)); });
      }
    }
  };

  const sched::Config config = sched::config_of(run);
  const auto scheduler = executors::make_scheduler(choice.executor, run, config);
  const executors::ExecutorKind *kind = executors::find_executor(choice.executor);
  sim::Options options;
  options.horizon = setup.duration;
  options.seed = setup.seed;
  // Events come in order of time, and the physics of every plant can follow them.
  sim::simulate(run, *scheduler, executors::effective_config(*kind, config).workers, options,
                [&](std::span<const JobEvent> batch) {
                  for (const JobEvent &event : batch) {
                    if (next_snapshot <= event.time) record_until(event.time);
                    const TaskRole &role = roles[event.task.value];
                    const bool starts = event.kind == JobEventKind::Dispatched;
                    if (role.role == Role::Sense && starts) role.loop->sense(event.time);
                    if (role.role == Role::Control && starts) role.loop->begin_control();
                    if (role.role == Role::Control && event.kind == JobEventKind::Finished) {
                      role.loop->end_control(event.value);
                    }
                  }
                  events.insert(events.end(), batch.begin(), batch.end());
                  return true;
                });
  if (next_snapshot != kNever) record_until(setup.duration);
  RunOutcome outcome = outcome_of(run, events, setup.duration, loops, std::move(snapshots));
  outcome.mode = trace::preemption_name(executors::effective_config(*kind, config).preemption);
  return outcome;
}

RunOutcome run_on_threads(const Workload &workload, const ExecutorChoice &choice, const RunSetup &setup) {
  const Workload run = configured(workload, choice);
  Loops loops(plants(), setup.seed);
  const std::vector<TaskRole> roles = loops.roles(run);
  std::vector<std::vector<Snapshot>> snapshots(loops.all().size());
  std::vector<Time> next_snapshot(loops.all().size(), 0);

  lab::RunOptions options;
  options.duration = setup.duration;
  options.seed = setup.seed;
  options.executor = choice.executor;
  options.realtime_threads = choice.realtime_threads;
  options.stop = setup.stop;
  options.bodies = [&](std::vector<runtime::Body> synthetic, const lab::Now &now) {
    // Wraps the synthetic body, which takes the processor for as long as the workload says.
    for (std::size_t t = 0; t < synthetic.size(); ++t) {
      const TaskRole role = roles[t];
      if (role.role == Role::None) continue;
      const auto plant = static_cast<std::size_t>(
          std::find_if(loops.all().begin(), loops.all().end(), [&](const auto &l) { return l.get() == role.loop; }) -
          loops.all().begin());
      synthetic[t] = [&, plant, role, now, burn = std::move(synthetic[t])](const runtime::Job &job) {
        if (role.role == Role::Control) {
          role.loop->begin_control();
          const sched::Outcome outcome = burn(job);
          role.loop->end_control(now());
          return outcome;
        }
        const Time start = now();
        role.loop->sense(start);
        if (setup.snapshots_every > 0 && start >= next_snapshot[plant]) {
          role.loop->look(start, [&](const Plant &seen) { snapshots[plant].push_back(snapshot(seen)); });
          next_snapshot[plant] = start + setup.snapshots_every;
        }
        return burn(job);
      };
    }
    return synthetic;
  };
  const Result<lab::RunResult> result = lab::run_workload(run, options);
  if (!result) throw std::runtime_error(to_string(result.error()));
  RunOutcome outcome = outcome_of(run, result->trace.events, result->trace.info.end, loops, std::move(snapshots));
  outcome.mode = to_string(result->mode.mode);
  return outcome;
}

}  // namespace closed_loop
