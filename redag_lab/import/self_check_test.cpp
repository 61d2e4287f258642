// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Random workloads, simulated, and recorded as ros2_tracing would.
#include "redag_lab/import/self_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "redag_lab/import/recorded_nodes_test.hpp"
#include "redag_lab/import/verdict.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::lab {
namespace {

// Nodes that run a workload: one for each task, with a timer, or a subscription for each predecessor. The message that
// completes the predecessors of a data task runs its job; earlier ones are stored. Every third timer task takes
// messages from outside instead.
class SimulatedNodes {
 public:
  SimulatedNodes(const Workload &workload, Recording &recording, bool some_outside = true) : nodes_(recording) {
    for (const TaskRef &ref : flatten(workload)) {
      Node &node = tasks_.emplace_back();
      node.name = name_of(ref.id);
      const auto handle = nodes_.node(node.name);
      const std::size_t first = ref.id.value - ref.index;
      for (const std::uint32_t p : ref.task->predecessors) {
        node.inputs.emplace_back(first + p, nodes_.subscription(handle, "/" + name_of(TaskId(first + p)) + "/out"));
      }
      node.is_outside = some_outside && node.inputs.empty() && ref.id.value % 3 == 2;
      if (node.is_outside) {
        node.source = nodes_.subscription(handle, "/outside/" + node.name);
      } else if (node.inputs.empty()) {
        nodes_.now = ref.task->offset;  // where the timer's grid begins
        node.source = nodes_.timer(handle, ref.task->period);
        nodes_.now = 0;
      }
      node.output = nodes_.publisher(handle, "/" + node.name + "/out");
    }
    for (std::size_t task = 0; task < tasks_.size(); ++task) {
      for (const auto &[from, callback] : tasks_[task].inputs) tasks_[from].successors.push_back(task);
    }
  }

  static std::string name_of(TaskId task) { return "n" + std::to_string(task.value); }

  /// Longest execution of each task in the recording.
  std::vector<Duration> longest;

  // Returns false if something happened that these nodes do not do.
  bool play(const std::vector<JobEvent> &events) {
    longest.assign(tasks_.size(), 0);
    for (const JobEvent &event : events) {
      nodes_.now = event.time;
      Node &node = tasks_[event.task.value];
      switch (event.kind) {
        case JobEventKind::Released: node.released = event.value; break;
        case JobEventKind::Dispatched:
          if (node.is_outside) nodes_.take(event.worker, node.source, kEpoch + node.released);
          node.running = node.inputs.empty() ? node.source : node.trigger;
          node.started = event.time;
          nodes_.start(event.worker, node.running);
          break;
        case JobEventKind::Finished:
          if (!node.successors.empty()) nodes_.publish(event.worker, node.output);
          nodes_.end(event.worker, node.running);
          longest[event.task.value] = std::max(longest[event.task.value], event.time - node.started);
          node.running = 0;
          for (const std::size_t to : node.successors) deliver(event.task.value, tasks_[to], event.worker);
          break;
        case JobEventKind::Ready:
        case JobEventKind::Started:
        case JobEventKind::Executed: break;
        default: return false;
      }
      if (overlapped_) return false;
    }
    return true;
  }

 private:
  static constexpr Time kEpoch = 1'700'000'000 * kSecond;  // messages have another clock than events

  struct Node {
    std::string name;
    std::vector<std::pair<std::size_t, RecordedNodes::Handle>> inputs;
    std::vector<std::size_t> successors;
    std::set<std::size_t> fresh;
    RecordedNodes::Handle source = 0;
    RecordedNodes::Handle output = 0;
    RecordedNodes::Handle trigger = 0;
    RecordedNodes::Handle running = 0;
    Time released = 0;
    Time started = 0;
    bool is_outside = false;
  };

  void deliver(std::size_t from, Node &to, std::uint32_t thread) {
    if (to.running != 0) overlapped_ = true;  // would wait for the node's group
    to.fresh.insert(from);
    const auto input = std::find_if(to.inputs.begin(), to.inputs.end(), [&](const auto &i) { return i.first == from; });
    if (to.fresh.size() == to.inputs.size()) {
      to.trigger = input->second;
      to.fresh.clear();
    } else {
      nodes_.start(thread, input->second);
      nodes_.end(thread, input->second);
    }
  }

  RecordedNodes nodes_;
  std::vector<Node> tasks_;
  bool overlapped_ = false;
};

GenerateOptions random_robots() {
  GenerateOptions options;
  options.dags = 3;
  options.utilization = 0.7;
  options.period_min = 10 * kMillisecond;
  options.period_max = 200 * kMillisecond;
  options.bcet_min = 0.5;
  return options;
}

trace::Trace simulated(const Workload &workload, std::uint64_t seed, Duration duration = 20 * kSecond) {
  SessionOptions session;
  session.duration = duration;
  session.seed = seed;
  Result<Session> run = run_session(workload, *parse_variant("mte"), session);
  if (run) return std::move(run->trace);
  ADD_FAILURE() << to_string(run.error());
  return {};
}

TEST(SimulatedRecording, IsImportedAsTheWorkload) {
  std::size_t used = 0;
  std::size_t edges = 0;
  std::size_t found_edges = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    const Result<Workload> generated = generate(random_robots(), seed);
    ASSERT_TRUE(generated);
    Recording recording;
    SimulatedNodes nodes(*generated, recording);
    if (!nodes.play(simulated(*generated, seed).events)) continue;
    ++used;
    const Result<ImportedWorkload> imported = import_workload(recording, 1);
    ASSERT_TRUE(imported) << to_string(imported.error());

    std::map<std::string, std::vector<TaskRef>> by_node;
    for (const TaskRef &ref : flatten(imported->workload)) by_node[ref.task->callback->node].push_back(ref);
    const auto node_of = [&](const TaskRef &ref, std::uint32_t p) {
      return imported->workload.dags[ref.dag.value].tasks[p].callback->node;
    };
    for (const TaskRef &original : flatten(*generated)) {
      const std::vector<TaskRef> &tasks = by_node["/" + SimulatedNodes::name_of(original.id)];
      // The task is the longest: others only store messages.
      const auto main = std::max_element(
          tasks.begin(), tasks.end(), [](const TaskRef &a, const TaskRef &b) { return a.task->wcet < b.task->wcet; });
      ASSERT_NE(main, tasks.end()) << to_yaml(*imported);
      EXPECT_EQ(main->task->period, original.task->period) << to_yaml(*imported);
      EXPECT_EQ(main->task->wcet, nodes.longest[original.id.value]) << to_yaml(*imported);
      EXPECT_EQ(main->task->activation, original.task->activation);
      std::set<std::string> expected;
      for (const std::uint32_t p : original.task->predecessors) {
        expected.insert("/" + SimulatedNodes::name_of(TaskId(original.id.value - original.index + p)));
      }
      // If the message of one predecessor is always the last, nothing tells that the task waits for the others, too:
      // they have tasks of their own, which store.
      std::set<std::string> waits_for;
      std::set<std::string> all;
      for (const TaskRef &ref : tasks) {
        for (const std::uint32_t p : ref.task->predecessors) {
          all.insert(node_of(ref, p));
          if (ref.id == main->id) waits_for.insert(node_of(ref, p));
        }
      }
      EXPECT_EQ(all, expected) << to_yaml(*imported);
      EXPECT_EQ(waits_for.empty(), expected.empty()) << to_yaml(*imported);
      edges += expected.size();
      found_edges += waits_for.size();
    }
    EXPECT_EQ(imported->explained, imported->executed);
    EXPECT_LE(imported->workload.platform.workers, generated->platform.workers);
  }
  EXPECT_GE(used, 50U);
  EXPECT_GT(static_cast<double>(found_edges), 0.7 * static_cast<double>(edges));
  RecordProperty("workloads", static_cast<int>(used));
  RecordProperty("edges", static_cast<int>(edges));
  RecordProperty("found", static_cast<int>(found_edges));
}

TEST(SimulatedRecording, IsReproducedByTheModelOfItsExecutor) {
  GenerateOptions options = random_robots();
  options.shape = DagShape::Chain;
  options.offsets = true;
  std::size_t tasks = 0;
  std::size_t reproduced = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const Result<Workload> generated = generate(options, seed);
    ASSERT_TRUE(generated);
    Recording recording;
    SimulatedNodes nodes(*generated, recording, false);
    ASSERT_TRUE(nodes.play(simulated(*generated, seed, 100 * kSecond).events));
    Result<ImportedWorkload> imported = import_workload(recording, 1);
    ASSERT_TRUE(imported) << to_string(imported.error());
    const Result<SelfCheck> check = check_against_recording(*imported);
    ASSERT_TRUE(check) << to_string(check.error());
    EXPECT_EQ(check->executor, "mte");
    EXPECT_EQ(check->tasks.size(), generated->task_count());
    for (const ReproducedTask &task : check->tasks) {
      EXPECT_LE(task.p50_error, 0.1) << task.name;
      ++tasks;
      if (task.is_reproduced()) ++reproduced;
    }
    // On one worker it is another robot.
    imported->workload.platform.workers = 1;
    const Result<SelfCheck> other = check_against_recording(*imported);
    ASSERT_TRUE(other) << to_string(other.error());
    EXPECT_FALSE(
        std::all_of(other->tasks.begin(), other->tasks.end(), [](const auto &t) { return t.is_reproduced(); }));
  }
}

// A run that lasted longer than nearly all was preempted, which threads of real-time priority are not.
TEST(SimulatedRecording, LeavesOutPreemptionInOsMode) {
  Recording recording;
  RecordedNodes nodes(recording);
  const auto timer = nodes.timer(nodes.node("robot"), 10 * kMs);
  for (Time k = 1; k <= 200; ++k) nodes.run(1, timer, k * 10 * kMs, k == 50 ? 6 * kMs : kMs);
  ImportedWorkload imported = import(recording);
  const auto longest = [&](const std::string &executor) {
    const Replayed replayed = replay(imported, imported.workload, *parse_variant(executor));
    const Result<Session> session = run_session(replayed.workload, *parse_variant(executor), replayed.options);
    return session ? session->summary.tasks.front().jobs.response.max : 0;
  };
  EXPECT_EQ(longest("ste"), 6 * kMs);
  EXPECT_EQ(longest("redag-none"), 6 * kMs);
  EXPECT_EQ(longest("redag-os"), kMs);
  imported.is_wall_time = false;  // the kernel's events show what an execution really took
  EXPECT_EQ(longest("redag-os"), 6 * kMs);
}

// ---- verdicts ----

// On one thread, a long callback of a slow timer makes a fast one late. Both share a node.
class Verdicts : public ::testing::Test {
 public:
  Verdicts() {
    const auto node = nodes_.node("robot");
    const auto fast = nodes_.timer(node, 10 * kMs);
    const auto slow = nodes_.timer(node, 100 * kMs);
    for (Time k = 1; k <= 400; ++k) {
      const bool waits = k > 10 && k % 10 == 1;  // for the slow one, which began just before
      if (k % 10 == 0) {
        nodes_.run(1, fast, k * 10 * kMs, kMs);
        nodes_.run(1, slow, k * 10 * kMs + kMs, 25 * kMs);
      } else if (waits) {
        nodes_.run(1, fast, k * 10 * kMs + 16 * kMs, kMs);
      } else if (k < 11 || k % 10 != 2) {
        nodes_.run(1, fast, k * 10 * kMs, kMs);
      }
    }
    Result<ImportedWorkload> made = import_workload(recording_, 1);
    if (made) imported = *std::move(made);
  }

  [[nodiscard]] SelfCheck check() const {
    SelfCheck check;
    check.executor = "ste";
    for (const TaskRef &ref : flatten(imported.workload)) check.tasks.push_back({ref.id, ref.task->name, {}, {}, 0, 0});
    check.tasks.back().p50_error = slow_error;
    return check;
  }
  [[nodiscard]] WhatIf verdict() const {
    const Result<WhatIf> result = judge(imported, check(), {.other_workers = 2});
    if (result) return *result;
    ADD_FAILURE() << to_string(result.error());
    return {};
  }

  ImportedWorkload imported;
  double slow_error = 0;

 private:
  Recording recording_;
  RecordedNodes nodes_{recording_};
};

TEST_F(Verdicts, SayWhatEachExecutorDoes) {
  const WhatIf result = verdict();
  ASSERT_EQ(result.outcomes.size(), 6U);
  const Outcome &ste = result.outcomes[0];
  EXPECT_EQ(ste.executor, "ste");
  EXPECT_EQ(ste.workers, 1U);
  EXPECT_GT(ste.missed, 30U);
  EXPECT_FALSE(ste.held[0]);
  const Outcome &os = result.outcomes[2];
  EXPECT_EQ(os.executor, "redag-os");
  EXPECT_EQ(os.workers, 1U);
  EXPECT_GT(os.missed, 30U) << "the callbacks share a group, which preemption does not open";
  EXPECT_EQ(result.outcomes[5].workers, 2U);
}

TEST_F(Verdicts, AStopEndsThem) {
  std::atomic<bool> stop{false};
  double last = -1;
  const auto progress = [&](double done) {
    EXPECT_GT(done, last);
    EXPECT_LT(done, 1);
    last = done;
    stop = done > 0.1;
  };
  const Result<WhatIf> result = judge(imported, check(), {.other_workers = 2, .stop = &stop, .progress = progress});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().front().message, "interrupted: there is no verdict");
}

TEST_F(Verdicts, NameChangesThatHelp) {
  for (Dag &dag : imported.workload.dags) {
    for (Task &task : dag.tasks) task.group.clear();
  }
  const WhatIf result = verdict();
  EXPECT_EQ(result.outcomes[2].missed, 0U);
  EXPECT_EQ(result.outcomes[2].shown, 2U);
  std::set<std::string> words;
  for (const TriedChange &change : result.changes) {
    EXPECT_LT(change.outcome.missed, result.outcomes[0].missed) << change.words;
    words.insert(change.words);
  }
  EXPECT_TRUE(words.contains("ReDAG-RT with preemption os"));
  EXPECT_TRUE(words.contains("/robot timer 100 ms (1) every 200ms instead of 100ms"));
}

TEST_F(Verdicts, AreRefusedWhereTheModelDiffers) {
  slow_error = 0.5;
  const WhatIf result = verdict();
  EXPECT_EQ(result.judged(), 1U);
  EXPECT_EQ(result.refused[0], "");
  EXPECT_NE(result.refused[1], "");
  EXPECT_EQ(result.outcomes[0].released, result.outcomes[0].summary.tasks[0].jobs.released);
}

}  // namespace
}  // namespace redag::lab
