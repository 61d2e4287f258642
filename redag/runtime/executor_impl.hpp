// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The implementation of Executor: the parts that run, and the DAGs. For executor*.cpp only.
#pragma once

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/engine/engine.hpp"
#include "redag/live/publisher.hpp"
#include "redag/runtime/event_source.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/runtime/miss_reporter.hpp"
#include "redag/runtime/recorder.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/runtime/watchdog.hpp"
#include "redag/threads/setup.hpp"
#include "redag/trace/trace.hpp"

namespace redag::runtime {

/// Throws std::invalid_argument.
[[noreturn]] void refuse(const std::string &what);

/// Throws std::invalid_argument for the first option out of its range.
void check(const ExecutorOptions &options);

class Executor::Impl {
 public:
  using Sources = std::vector<std::shared_ptr<EventSource>>;  // by task of a DAG; null: not event()

  explicit Impl(ExecutorOptions options);
  ~Impl();
  Impl(const Impl &) = delete;
  Impl &operator=(const Impl &) = delete;

  DagId add(Dag dag, std::vector<TaskBody> bodies, Sources sources);
  void remove(DagId dag);
  void run_for(nanoseconds duration);
  void start();
  void wait();
  void stop();
  void request_stop() noexcept;
  void drain(std::vector<JobEvent> &events);
  [[nodiscard]] DagStats stats(DagId dag) const;
  [[nodiscard]] DeviceHandle device(std::string_view name) const;
  [[nodiscard]] std::vector<std::string> warnings() const;
  [[nodiscard]] std::string task_name(TaskId task) const;
  [[nodiscard]] const Setup &setup() const { return setup_; }
  [[nodiscard]] const Engine &engine() const { return *engine_; }

 private:
  struct Added {
    Dag dag;
    Sources sources;
    AddedDag ids;          // the engine's ids
    Time base = 0;         // where its release grid begins
    std::size_t left = 0;  // how many of the tasks' ids no later task has
    bool removed = false;
    Time removed_at = 0;
  };
  struct Owner {
    DagId dag;  // the executor's id, not the engine's
    std::uint32_t position = 0;
    Time since = 0;  // jobs released earlier belong to a former task with this id
  };
  bool begin(Time origin);
  void finish();
  void finish_record();
  void disconnect_sources();
  void admit(const Dag &dag) const REDAG_REQUIRES(adding_);
  void on_overdue(const OverdueJob &job);
  [[nodiscard]] Result<void> start_threads();
  [[nodiscard]] bool is_own_thread() const;
  void sample(live::Sample &sample) const;
  void on_exception(const Job &job, std::exception_ptr exception);
  void on_miss(const Miss &miss, std::uint64_t unreported);
  void fail(std::exception_ptr exception);
  [[nodiscard]] trace::RunInfo run_info() const;
  [[nodiscard]] Workload workload() const;
  [[nodiscard]] bool has_dag(const std::string &name) const;
  void own(DagId dag, const std::vector<TaskId> &tasks, Time since) REDAG_REQUIRES(lock_);
  [[nodiscard]] std::string name_of(const Owner &owner) const REDAG_REQUIRES(lock_);

  ExecutorOptions options_;
  Setup setup_;                           // its warnings: under lock_ once the run has begun
  std::unique_ptr<MissReporter> misses_;  // on_deadline_miss
  std::unique_ptr<Recorder> recorder_;    // `record`
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<ReleaseTimer> timer_;
  std::unique_ptr<Watchdog> watchdog_;  // runs from start() until no body is left
  Mutex adding_;  // held by the one thread that adds a DAG, also while options_.admission computes; taken before lock_
  mutable PiMutex lock_{LockClass::Bounded};  // threads above all jobs take it
  // Without a trace the engine uses ids again. Memory then does not grow with the number of former DAGs.
  std::map<std::uint32_t, Added> dags_ REDAG_GUARDED_BY(lock_);  // by DagId
  std::uint32_t next_dag_ REDAG_GUARDED_BY(lock_) = 0;
  std::vector<Owner> owners_ REDAG_GUARDED_BY(lock_);   // by TaskId
  std::exception_ptr failure_ REDAG_GUARDED_BY(lock_);  // the first exception that stopped the executor
  bool running_ REDAG_GUARDED_BY(lock_) = false;
  Mutex finishing_;  // held by the one thread that begins or ends the run
  Atomic<bool> started_{false};
  Atomic<bool> finished_{false};
  Event stop_;
  std::unique_ptr<live::Publisher> live_;  // last: asks for figures until it is destroyed
};

}  // namespace redag::runtime
