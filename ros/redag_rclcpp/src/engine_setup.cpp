// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "engine_setup.hpp"

#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>

#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/threads.hpp"

namespace redag_rclcpp {

using std::chrono::nanoseconds;

ReDAGOptions checked(ReDAGOptions options) {
  if (options.default_period <= nanoseconds(0)) {
    throw std::invalid_argument(
        "default_period must be greater than 0, because callbacks with shorter periods are more urgent");
  }
  if (options.watchdog < nanoseconds(0)) throw std::invalid_argument("watchdog must not be negative");
  return options;
}

const std::vector<redag::Device> &devices_of(const ReDAGOptions &options) {
  static const std::vector<redag::Device> none;
  return options.workload ? (*options.workload)->platform.devices : none;
}

redag::runtime::Setup set_up(const ReDAGOptions &options) {
  const redag::Workload plain;
  const redag::Workload &workload = options.workload ? **options.workload : plain;
  auto setup = redag::runtime::set_up({.preemption = options.preemption,
                                       .policy = workload.policy,
                                       .ties = workload.ties,
                                       .workers = options.workers,
                                       .threads = options.threads,
                                       .cpus = options.cpus});
  if (!setup) throw std::runtime_error(to_string(setup.error()));
  return *std::move(setup);
}

std::unique_ptr<redag::runtime::Engine> make_engine(
    const ReDAGOptions &options, const redag::runtime::Setup &setup, redag::Time origin,
    std::function<void(const redag::runtime::Job &, std::exception_ptr)> on_exception) {
  redag::runtime::EngineOptions engine_options;
  if (options.lock_memory) engine_options.touched_stack = redag::runtime::kTouchedStack;
  engine_options.config = setup.config;
  engine_options.config.reuse_ids = options.trace_capacity == 0;  // in a trace an id stands for one task
  engine_options.band = setup.band;
  engine_options.order_folder = setup.order_folder;
  engine_options.cpus = options.cpus;
  engine_options.spare_threads = setup.spare_threads;
  engine_options.trace_capacity = options.trace_capacity;
  engine_options.measure = true;
  engine_options.waits_priority = setup.timer_priority();
  engine_options.on_exception = std::move(on_exception);
  redag::Workload empty;
  empty.platform.devices = devices_of(options);
  auto scheduler = std::make_unique<redag::sched::PriorityScheduler>(empty, engine_options.config);
  auto engine = std::make_unique<redag::runtime::Engine>(std::move(scheduler), std::move(engine_options));
  engine->set_origin(origin);
  engine->pause();
  return engine;
}

}  // namespace redag_rclcpp
