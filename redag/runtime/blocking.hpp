// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A scope in which a body may block without holding its worker. docs/runtime.md, "Calls that block", has the rules.
#pragma once

namespace redag {

namespace runtime {

struct RunningJob;

}  // namespace runtime

/// While it lives, the job that constructed it waits, and its worker runs other jobs on another thread:
///
///     { redag::Blocking scope; n = read(file, data, size); }
///
/// The destructor returns once the job has a worker again. For calls of any kind that sleep: files, sockets, condition
/// variables, futures. Keep what computes out of the scope: there it runs beside the jobs that have a worker. Construct
/// and destroy it on the thread of the body. No co_await in the scope. The constructor allocates only while more jobs
/// block at a time than ever before, and can throw std::bad_alloc.
class Blocking {
 public:
  Blocking();
  ~Blocking();
  Blocking(const Blocking &) = delete;
  Blocking &operator=(const Blocking &) = delete;

  /// Returns false if the job keeps its worker: outside a job, in another Blocking, on top of another job (preemption:
  /// cooperative), or if no thread is left (ExecutorOptions::threads). TaskStats::kept_worker counts the last
  /// two.
  [[nodiscard]] bool lends() const { return job_ != nullptr; }

 private:
  runtime::RunningJob *job_;  // null: it keeps its worker
};

}  // namespace redag
