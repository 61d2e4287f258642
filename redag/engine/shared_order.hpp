// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's part in an order that several executors share (`os`): a thread states its rates, reads those of the
// others several times a second, and moves its threads to the priorities that follow. Also gives the release thread
// its priority, with a shared order or without. The engine's lock guards what it is given.
#pragma once

#include <memory>
#include <string>

#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/engine/job_placement.hpp"
#include "redag/engine/task_table.hpp"
#include "redag/live/order_page.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/threads/common_order.hpp"
#include "redag/threads/helper_thread.hpp"
#include "redag/threads/release_thread.hpp"

namespace redag::runtime {

class SharedOrder {
 public:
  /// What the order depends on, and what it moves. All of it outlives this object.
  struct Parts {
    PiMutex &lock;
    const sched::Scheduler &scheduler;
    const TaskTable &tasks;
    JobPlacement &placement;
  };
  SharedOrder(Parts parts, PolicyKind policy) : parts_(parts), policy_(policy) {}

  /// Takes part in the order of the executors with pages in `folder`. The first job already has its place in it. Error:
  /// what the system refused; call end() then.
  [[nodiscard]] Result<void> start(const std::string &folder, int top_job, const std::string &thread_name);
  /// Takes no part any more.
  void end();

  /// Tasks or their rates have changed. Under the lock.
  void tasks_changed();
  /// Gives the release thread (null: none), and the leader in its place, the priority that follows from the levels.
  /// Under the lock.
  void move_releases(ReleaseThread *thread);
  /// Why the other executors do not know this one's rates; "": they do. Under the lock.
  [[nodiscard]] const std::string &problem() const { return problem_; }

 private:
  void follow() noexcept;
  Result<void> look();
  void map_levels();
  void update_statement();

  const Parts parts_;
  const PolicyKind policy_;
  HelperThread thread_;
  // start()'s, then the thread's:
  std::unique_ptr<live::OwnOrderPage> page_;
  std::string folder_;
  live::OrderStatement statement_;
  // Guarded by the lock:
  bool rates_changed_ = true;  // since the statement was made
  CommonOrder order_;
  std::string problem_;
  ReleaseThread *releases_ = nullptr;  // once it has a priority from here
};

}  // namespace redag::runtime
