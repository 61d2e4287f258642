// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Random workloads, simulated, and recorded as ros2_tracing would: import gives them back.

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "redag_lab/import/model.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"
#include "redag_lab/workload/generate.hpp"
#include "tests/testing/recorded_nodes.hpp"

namespace redag::lab {
namespace {

using redag::testing::RecordedNodes;

// Nodes that run a workload: one for each task, with a timer, or a subscription for each predecessor. The message that
// completes the predecessors of a data task runs its job; earlier ones are stored. Every third timer task takes
// messages from outside instead.
class SimulatedNodes {
 public:
  SimulatedNodes(const Workload &workload, Recording &recording) : nodes_(recording) {
    for (const TaskRef &ref : flatten(workload)) {
      Node &node = tasks_.emplace_back();
      node.name = name_of(ref.id);
      const auto handle = nodes_.node(node.name);
      const std::size_t first = ref.id.value - ref.index;
      for (const std::uint32_t p : ref.task->predecessors) {
        node.inputs.emplace_back(first + p, nodes_.subscription(handle, "/" + name_of(TaskId(first + p)) + "/out"));
      }
      node.is_outside = node.inputs.empty() && ref.id.value % 3 == 2;
      if (node.is_outside) {
        node.source = nodes_.subscription(handle, "/outside/" + node.name);
      } else if (node.inputs.empty()) {
        node.source = nodes_.timer(handle, ref.task->period);
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
          nodes_.publish(event.worker, node.output);
          nodes_.end(event.worker, node.running);
          longest[event.task.value] = std::max(longest[event.task.value], event.time - node.started);
          node.running = 0;
          for (const std::size_t to : node.successors) deliver(event.task.value, tasks_[to]);
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
  static constexpr std::uint32_t kStoring = 1000;          // thread of callbacks that store a message

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

  void deliver(std::size_t from, Node &to) {
    if (to.running != 0) overlapped_ = true;  // would wait for the node's group
    to.fresh.insert(from);
    const auto input = std::find_if(to.inputs.begin(), to.inputs.end(), [&](const auto &i) { return i.first == from; });
    if (to.fresh.size() == to.inputs.size()) {
      to.trigger = input->second;
      to.fresh.clear();
    } else {
      nodes_.start(kStoring, input->second);
      nodes_.end(kStoring, input->second);
    }
  }

  RecordedNodes nodes_;
  std::vector<Node> tasks_;
  bool overlapped_ = false;
};

TEST(SimulatedRecording, IsImportedAsTheWorkload) {
  GenerateOptions options;
  options.dags = 3;
  options.utilization = 0.7;
  options.period_min = 10 * kMillisecond;
  options.period_max = 200 * kMillisecond;
  options.bcet_min = 0.5;
  std::size_t used = 0;
  std::size_t edges = 0;
  std::size_t found_edges = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    const Result<Workload> generated = generate(options, seed);
    ASSERT_TRUE(generated);
    SessionOptions session;
    session.duration = 20 * kSecond;
    session.seed = seed;
    const Result<Session> run = run_session(*generated, *parse_variant("mte"), session);
    ASSERT_TRUE(run) << to_string(run.error());
    Recording recording;
    SimulatedNodes nodes(*generated, recording);
    if (!nodes.play(run->trace.events)) continue;
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
  }
  EXPECT_GE(used, 50U);
  EXPECT_GT(static_cast<double>(found_edges), 0.7 * static_cast<double>(edges));
  RecordProperty("workloads", static_cast<int>(used));
  RecordProperty("edges", static_cast<int>(edges));
  RecordProperty("found", static_cast<int>(found_edges));
}

}  // namespace
}  // namespace redag::lab
