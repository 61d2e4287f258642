// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/features.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include <fmt/format.h>

namespace redag::testing {
namespace {

// Features of which a run has one at most.
bool is_mode(Feature feature) { return feature == Feature::Cooperative || feature == Feature::FullPreemption; }
bool is_policy(Feature feature) { return feature >= Feature::DeadlineMonotonic && feature <= Feature::Fifo; }

class Collector {
 public:
  Collector(const Workload &workload, const sched::Config &config) : workload_(workload), config_(config) {
    see(Feature::SeveralWorkers, config.workers > 1);
    see(Feature::FullPreemption, config.preemption == sched::Preemption::Full);
    see(Feature::SharedLevels, config.levels > 0 && config.levels < workload.task_count());
    see(Feature::ThreadLimit, config.max_started > 0);
    see(Feature::FixedTies, config.ties == Ties::Fixed && config.policy != PolicyKind::Fifo);
    see(Feature::DeadlineMonotonic, config.policy == PolicyKind::DeadlineMonotonic);
    see(Feature::FixedPriorities, config.policy == PolicyKind::Fixed);
    see(Feature::ChainAware, config.policy == PolicyKind::ChainAware);
    see(Feature::Edf, config.policy == PolicyKind::Edf);
    see(Feature::Fifo, config.policy == PolicyKind::Fifo);
    see(Feature::Clusters, workload.platform.clusters.size() > 1);
    for (const Dag &dag : workload.dags) has_modes_ = has_modes_ || begins_mode(dag);
    for (const Dag &dag : workload.dags) collect(dag);
    see(Feature::SeveralRates, rates_.size() > 1);
    for (const auto &[group, dags] : dags_of_group_) see(Feature::GroupsAcrossDags, dags.size() > 1);
  }

  [[nodiscard]] const FeatureSet &found() const { return found_; }

 private:
  void see(Feature feature, bool is_there) {
    if (is_there) found_.set(static_cast<std::size_t>(feature));
  }

  static bool begins_mode(const Dag &dag) {
    return std::any_of(dag.tasks.begin(), dag.tasks.end(),
                       [](const Task &task) { return task.wcet_low > 0 && task.wcet_low < task.wcet; });
  }

  void collect(const Dag &dag) {
    see(Feature::MaxActive, dag.max_active > 0);
    see(Feature::MaxPending, dag.max_pending > 0);
    see(Feature::EndToEndDeadlines, dag.deadline > 0);
    see(Feature::HighMode, begins_mode(dag));
    see(Feature::Degraded,
        has_modes_ && dag.criticality != Criticality::High && dag.degrade.kind != Degrade::Kind::Stop);
    for (const Task &task : dag.tasks) {
      collect(task, dag);
      for (const std::uint32_t p : task.predecessors) collect_edge(dag.tasks[p], task);
    }
  }

  void collect(const Task &task, const Dag &dag) {
    rates_.insert(task.period);
    see(Feature::Cooperative, config_.preemption == sched::Preemption::Cooperative && task.region > 0);
    see(Feature::Joins, task.activation == Activation::Data && task.predecessors.size() > 1);
    see(Feature::Offsets, task.offset > 0);
    see(Feature::Jitter, task.jitter > 0);
    see(Feature::FreeTimers, task.phase == Phase::Unknown);
    see(Feature::Events, task.phase == Phase::Event);
    see(Feature::VaryingExecution, task.execution.kind != ExecutionTime::Kind::Constant);
    see(Feature::ShortDeadlines, task.deadline < task.period);
    see(Feature::Queues, task.overrun == Overrun::Queue);
    see(Feature::Overlap, task.concurrency > 1);
    see(Feature::Groups, !task.group.empty());
    if (!task.group.empty()) dags_of_group_[task.group].insert(dag.name);
    const bool can_exceed = task.budget > 0 && task.budget < task.wcet;
    see(Feature::CutOff, can_exceed && task.on_budget == OnBudget::Abort);
    see(Feature::BudgetsThatGoOn, can_exceed && task.on_budget != OnBudget::Abort);
    for (const Wait &wait : task.waits) {
      see(Feature::Waits, !wait.device.valid());
      if (!wait.device.valid()) continue;
      const Device &device = workload_.platform.devices[wait.device.value];
      see(device.queue == Device::Queue::Fifo ? Feature::FifoDevices : Feature::PriorityDevices, true);
    }
  }

  void collect_edge(const Task &from, const Task &to) {
    const bool same_rate = from.period == to.period && (to.activation == Activation::Data || from.offset == to.offset);
    see(Feature::DataEdges, to.activation == Activation::Data);
    see(Feature::RateEdges, !same_rate);
    see(Feature::AlignedEdges, same_rate && to.activation == Activation::Timer && from.activation == to.activation);
  }

  const Workload &workload_;
  const sched::Config &config_;
  bool has_modes_ = false;
  std::set<Duration> rates_;
  std::map<std::string, std::set<std::string>> dags_of_group_;
  FeatureSet found_;
};

}  // namespace

const char *to_string(Feature feature) {
  constexpr std::array<const char *, kFeatures> kNames = {"several workers",
                                                          "cooperative",
                                                          "full preemption",
                                                          "shared levels",
                                                          "thread limit",
                                                          "deadline order",
                                                          "fixed priorities",
                                                          "chain_aware",
                                                          "edf",
                                                          "fifo",
                                                          "fixed ties",
                                                          "data edges",
                                                          "joins",
                                                          "aligned edges",
                                                          "rate edges",
                                                          "several rates",
                                                          "offsets",
                                                          "jitter",
                                                          "free timers",
                                                          "events",
                                                          "varying wcet",
                                                          "short deadlines",
                                                          "end to end",
                                                          "queues",
                                                          "overlap",
                                                          "groups",
                                                          "groups across DAGs",
                                                          "max_active",
                                                          "max_pending",
                                                          "cut off",
                                                          "other budgets",
                                                          "HI mode",
                                                          "degraded",
                                                          "waits",
                                                          "priority devices",
                                                          "fifo devices",
                                                          "clusters"};
  return kNames[static_cast<std::size_t>(feature)];
}

FeatureSet features_of(const Workload &workload, const sched::Config &config) {
  return Collector(workload, config).found();
}

const char *why_never_together(Feature a, Feature b) {
  if (a > b) std::swap(a, b);
  if (a == b) return nullptr;
  if (is_mode(a) && is_mode(b)) return "a run has one preemption mode";
  if (is_policy(a) && is_policy(b)) return "a run has one policy";
  if (a == Feature::Cooperative && (b == Feature::SharedLevels || b == Feature::ThreadLimit))
    return "only full preemption has levels, and one thread a job";
  if (a == Feature::SharedLevels && (b == Feature::Edf || b == Feature::Fifo)) return "jobs have no levels";
  if (a == Feature::Fifo && b == Feature::FixedTies) return "fifo has no ties";
  if (a == Feature::PriorityDevices && b == Feature::Clusters) return "no order of jobs spans two clusters";
  return nullptr;
}

void FeaturePairs::add(const FeatureSet &features) {
  for (std::size_t a = 0; a < kFeatures; ++a) {
    if (!features[a]) continue;
    for (std::size_t b = a; b < kFeatures; ++b) runs_[a][b] += features[b] ? 1U : 0U;
  }
}

std::string FeaturePairs::to_string() const {
  std::size_t pairs = 0;
  std::size_t tried = 0;
  std::uint32_t least = std::numeric_limits<std::uint32_t>::max();
  std::string rarest;
  visit([&](Feature a, Feature b, std::uint32_t runs) {
    ++pairs;
    if (runs == 0) return;
    ++tried;
    if (runs >= least) return;
    least = runs;
    rarest = fmt::format("{} with {}", testing::to_string(a), testing::to_string(b));
  });
  return fmt::format("{} of {} pairs of features, the rarest in {} runs ({})", tried, pairs, least, rarest);
}

}  // namespace redag::testing
