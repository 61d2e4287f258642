// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What to_yaml() writes is read as it was; files damaged at random are refused, not crashed on.
#include "redag/loader/workload_yaml.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/loader/validate.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag {
namespace {

Callback arbitrary_callback(Activation activation) {
  using Kind = Callback::Kind;
  Callback callback;
  callback.node = *rc::gen::element<std::string>("/a", "*", "?", "/lidar_*", "*/x_?", "/n/o");
  callback.kind = *rc::gen::element(Kind::Subscription, Kind::Service, Kind::Client, Kind::Action, Kind::Waitable);
  if (activation == Activation::Timer && *rc::gen::arbitrary<bool>()) callback.kind = Kind::Timer;
  if (callback.kind == Kind::Timer) callback.period = *rc::gen::element<Duration>(0, 1, 2 * kMillisecond);
  if (callback.kind == Kind::Timer || callback.kind == Kind::Waitable) {
    if (*rc::gen::arbitrary<bool>()) callback.index = *rc::gen::element(0U, 7U, UINT32_MAX);
  } else {
    callback.name = *rc::gen::element<std::string>("/imu/data", "*", "/a?*");
  }
  return callback;
}

/// Divides the platform. Groups become those of one cluster.
void add_clusters(Workload &workload) {
  std::vector<Cluster> &clusters = workload.platform.clusters;
  clusters = {Cluster{"left", *rc::gen::inRange(1U, 9U), {}}, Cluster{"- right: 2", 1, {4}}};
  clusters[0].cpus = *rc::gen::element(std::vector<int>{}, std::vector<int>{0}, std::vector<int>{0, 1, 3, 5, 6});
  workload.platform.workers = clusters[0].workers + 1;
  for (Dag &dag : workload.dags) {
    dag.cluster = *rc::gen::element(clusters[0].name, clusters[1].name);
    for (Task &task : dag.tasks) {
      if (!task.group.empty()) task.group += dag.cluster;
    }
  }
}

/// Lets some tasks wait for devices, or for nothing that is named.
void add_devices(Workload &workload) {
  workload.platform.devices = {Device{"gpu", 1, Device::Queue::Fifo}, Device{"- a: b", kMaxSlots, {}}};
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.wcet < 3 || *rc::gen::arbitrary<bool>()) continue;
      task.waits = {Wait{.after = 1, .longest = 5, .shortest = *rc::gen::element<Duration>(0, 1, 5), .device = {}}};
      task.waits.push_back(
          Wait{.after = 2, .longest = kMicrosecond, .shortest = 0, .device = DeviceId(*rc::gen::element(0U, 1U))});
    }
  }
}

/// Releases some sources by events, or at any offset. Timer tasks with predecessors would need theirs to be common.
void add_phases(Dag &dag) {
  const auto joins = [](const Task &task) {
    return task.activation == Activation::Timer && !task.predecessors.empty();
  };
  if (std::any_of(dag.tasks.begin(), dag.tasks.end(), joins)) return;
  for (Task &task : dag.tasks) {
    if (task.activation == Activation::Data || task.offset != 0) continue;
    task.phase = *rc::gen::element(Phase::Common, Phase::Unknown, Phase::Event);
  }
}

/// A generated workload with every optional part drawn, too.
Workload arbitrary_workload() {
  lab::GenerateOptions options;
  options.dags = *rc::gen::inRange(1U, 5U);
  options.min_tasks = 1;
  options.max_tasks = *rc::gen::inRange(1U, 10U);
  options.utilization = 0.5;
  options.shape = *rc::gen::element(lab::DagShape::Layered, lab::DagShape::ErdosRenyi, lab::DagShape::ForkJoin);
  options.rates = *rc::gen::element(lab::RateScope::PerDag, lab::RateScope::PerTask);
  options.periods = *rc::gen::element(lab::PeriodModel::LogUniform, lab::PeriodModel::Robot);
  options.policy = *rc::gen::element(PolicyKind::RateMonotonic, PolicyKind::Fixed, PolicyKind::Fifo);
  options.data_share = 0.6;
  options.bcet_min = *rc::gen::element(0.0, 0.5, 1.0);
  options.jitter = 0.3;
  options.offsets = *rc::gen::arbitrary<bool>();
  options.deadline_min = 0.5;
  options.max_active_max = 3;
  options.groups = 2;
  options.group_share = 0.3;
  options.queue_share = 0.3;
  Workload workload = generate(options, *rc::gen::arbitrary<std::uint64_t>()).value();
  workload.platform.preemption = *rc::gen::element(PreemptionMode::None, PreemptionMode::Cooperative);
  workload.ties = *rc::gen::element(Ties::Share, Ties::Fixed);
  workload.name = *rc::gen::element<std::string>("", "plain", "null", "~", "yes", "- a", "a: b", "#x", "'", "\"", "x y",
                                                 "{", "*a", "5ms", "caf\xC3\xA9", "a,b]", "\xF0\x9F\xA4\x96", "!t");
  for (Dag &dag : workload.dags) {
    dag.max_pending = *rc::gen::inRange(0U, 3U);
    dag.edges = *rc::gen::element(Edges::Executed, Edges::Seen);
    dag.deadline = *rc::gen::element<Duration>(0, 7 * kMillisecond);
    dag.criticality = *rc::gen::element(Criticality::Low, Criticality::Normal, Criticality::High);
    if (dag.criticality != Criticality::High) {
      dag.degrade = *rc::gen::element(Degrade{}, Degrade{Degrade::Kind::Skip, 3, 2},
                                      Degrade{Degrade::Kind::Stretch, 1, 1.0 / 3 + 1});
    }
    for (Task &task : dag.tasks) {
      task.name += *rc::gen::element<std::string>("", ": x", "#", " \"", "'", ",", "]", "\\", "\xC3\xA9");
      task.criticality = dag.criticality;
      task.region = *rc::gen::element<Duration>(0, 1, 50 * kMicrosecond);
      task.budget = *rc::gen::element<Duration>(0, task.wcet);
      if (task.budget > 0) {
        task.on_budget = *rc::gen::element(OnBudget::Abort, OnBudget::Log, OnBudget::Demote, OnBudget::SkipNext);
      }
      if (dag.criticality == Criticality::High) task.wcet_low = *rc::gen::element<Duration>(0, 1, task.wcet);
      if (*rc::gen::arbitrary<bool>()) task.execution = {ExecutionTime::Kind::Normal, task.wcet, 3, {}};
      if (*rc::gen::arbitrary<bool>()) task.execution = {ExecutionTime::Kind::Empirical, 0, 0, {task.wcet, task.wcet}};
      if (*rc::gen::arbitrary<bool>()) task.execution = {ExecutionTime::Kind::Constant, 0, 0, {}};
      if (task.group.empty()) task.concurrency = *rc::gen::element(1U, 2U, kMaxConcurrency);
      if (*rc::gen::arbitrary<bool>()) task.callback = arbitrary_callback(task.activation);
      // The timer's own rate, or another one.
      if (task.callback && task.callback->period != 0 && *rc::gen::arbitrary<bool>()) {
        task.callback->period = task.period;
      }
    }
  }
  for (Dag &dag : workload.dags) add_phases(dag);
  if (*rc::gen::arbitrary<bool>()) {
    add_clusters(workload);
  } else if (*rc::gen::arbitrary<bool>()) {
    add_devices(workload);
  }
  return workload;
}

TEST(ToYaml, WritesAsPeopleDo) {
  const std::string text =
      "name: w\n"
      "platform: {workers: 2, cpus: \"2,5\", preemption: auto}\n"
      "policy: rate_monotonic\n"
      "dags:\n"
      "  - name: d\n"
      "    rate: 30Hz\n"
      "    tasks:\n"
      "      - {name: a, wcet: 200us}\n"
      "      - {name: b, wcet: 1.5ms, activation: data, after: a}\n"
      "      - {name: c, wcet: 1ms, activation: timer, after: [a, b]}\n";
  const Result<LoadedWorkload> loaded = parse_workload(text, "w.yaml");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  EXPECT_EQ(to_yaml(loaded->workload), text);
}

TEST(ToYaml, WritesPeriodsThatAreNoWholeRateAsTheyAre) {
  const auto written = [](const char *period) {
    const std::string text = std::string("dags: [{name: d, tasks: [{name: t, wcet: 1us, ") + period + "}]}]";
    const std::string out = to_yaml(parse_workload(text, "w.yaml")->workload);
    const std::size_t at = out.find("    ", out.find("name: d"));
    return out.substr(at + 4, out.find('\n', at) - at - 4);
  };
  EXPECT_EQ(written("period: 33.333333ms"), "rate: 30Hz");
  EXPECT_EQ(written("period: 33.333334ms"), "period: 33.333334ms");
  EXPECT_EQ(written("rate: 400Hz"), "period: 2.5ms");
  EXPECT_EQ(written("rate: 3kHz"), "period: 333.333us");
}

TEST(ToYaml, WritesTheKindOfDegradationAndNotWhatAnotherKindWouldUse) {
  Workload workload =
      parse_workload("dags: [{name: d, tasks: [{name: t, wcet: 1us, period: 1ms}]}]", "w.yaml")->workload;
  workload.dags[0].degrade = Degrade{Degrade::Kind::Stop, 3, 2.5};
  EXPECT_EQ(parse_workload(to_yaml(workload), "w.yaml")->workload.dags[0].degrade.kind, Degrade::Kind::Stop);
}

RC_GTEST_PROP(ToYaml, RoundTrips, ()) {
  const Workload workload = arbitrary_workload();
  const std::string text = to_yaml(workload);
  const Result<LoadedWorkload> loaded = parse_workload(text, "round.yaml", {.waits = true});
  if (!loaded) RC_FAIL(to_string(loaded.error()) + "\n" + text);
  RC_ASSERT(loaded->workload == workload);
}

RC_GTEST_PROP(ToYaml, RoundTripsWithoutWcets, ()) {
  Workload workload = arbitrary_workload();
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (!task.callback || *rc::gen::arbitrary<bool>()) continue;
      task.wcet = task.bcet = 0;
      task.waits.clear();
      task.execution = {};
    }
  }
  const Result<LoadedWorkload> loaded =
      parse_workload(to_yaml(workload), "round.yaml", {.wcet_optional = true, .waits = true});
  if (!loaded) RC_FAIL(to_string(loaded.error()) + "\n" + to_yaml(workload));
  RC_ASSERT(loaded->workload == workload);
}

RC_GTEST_PROP(ParseWorkload, NeverCrashesOnBrokenFiles, ()) {
  std::string text = to_yaml(arbitrary_workload());
  const auto edits = *rc::gen::inRange(1, 6);
  for (int i = 0; i < edits; ++i) {
    const auto at = *rc::gen::inRange<std::size_t>(0, text.size());
    switch (*rc::gen::inRange(0, 4)) {
      case 0: text.erase(at, *rc::gen::inRange<std::size_t>(1, 30)); break;
      case 1:
        text[at] = *rc::gen::element('{', '}', '[', ']', ':', ',', '-', '\n', ' ', '#', '&', '*', '"', '0', '\xff');
        break;
      case 2: text.insert(at, text.substr(*rc::gen::inRange<std::size_t>(0, text.size()), 40)); break;
      default: text.resize(at); break;
    }
    if (text.empty()) break;
  }
  const Result<LoadedWorkload> loaded = parse_workload(text, "broken.yaml");
  if (loaded) {
    RC_ASSERT(!has_errors(validate(loaded->workload)));
  } else {
    RC_ASSERT(has_errors(loaded.error()));
  }
}

}  // namespace
}  // namespace redag
