// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/executors.hpp"

#include "redag_analysis/many_workers/dag_isolated.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/peers/wait_set.hpp"

namespace redag::analysis {

const std::vector<Method> &executor_methods() {
  static const std::vector<Method> kAll = {wait_set()};
  return kAll;
}

const std::vector<Method> &methods_of(const executors::ExecutorKind &executor) {
  static const std::vector<Method> kAnyOrder = {isolated(), dag_any()};
  static const std::vector<Method> kWaitSet = [] {
    std::vector<Method> all = executor_methods();
    all.insert(all.end(), kAnyOrder.begin(), kAnyOrder.end());
    return all;
  }();
  if (executor.ours) return methods();
  // The static executor has windows, too, but walks through them in another order than these bounds assume.
  return executor.name == "ste" || executor.name == "mte" ? kWaitSet : kAnyOrder;
}

AnalysisPlatform effective_platform(const executors::ExecutorKind &executor, AnalysisPlatform platform) {
  sched::Config config;
  config.workers = platform.workers;
  config.preemption = platform.preemption;
  config.levels = platform.levels;
  config.max_started = platform.max_started;
  config = executors::effective_config(executor, config);
  platform.workers = config.workers;
  platform.preemption = config.preemption;
  platform.levels = config.levels;
  platform.max_started = config.max_started;
  return platform;
}

Result<TaskSet> compile_for(const executors::ExecutorKind &executor, const Workload &workload,
                            const AnalysisPlatform &platform) {
  const AnalysisPlatform effective = effective_platform(executor, platform);
  if (executor.ours) return compile(workload, effective);
  Workload seen = workload;
  for (Dag &dag : seen.dags) dag.max_active = 0;
  return compile(seen, effective);
}

}  // namespace redag::analysis
