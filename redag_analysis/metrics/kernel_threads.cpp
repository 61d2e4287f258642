// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/kernel_threads.hpp"

#include <variant>

namespace redag::metrics {
namespace {

std::uint64_t key_of(TaskId task, std::uint32_t number) { return (std::uint64_t{task.value} << 32U) | number; }

}  // namespace

void KernelThreads::add(const KernelRow &row) {
  if (const auto *process = std::get_if<KernelProcess>(&row)) {
    processes_[process->process] = process->name;
  } else if (const auto *thread = std::get_if<KernelThread>(&row)) {
    // The kernel gives numbers of threads that have ended to new ones.
    own_.erase(thread->thread);
    others_.erase(thread->thread);
    if (thread->process != 0) {
      own_[thread->thread] = *thread;
    } else {
      others_[thread->thread] = thread->name;
    }
  } else if (const auto *job = std::get_if<JobThread>(&row)) {
    if (!jobs_.insert_or_assign(key_of(job->task, job->number), job->thread).second) return;
    job_order_.push_back(key_of(job->task, job->number));
    if (job_order_.size() <= kMostJobs) return;
    jobs_.erase(job_order_.front());
    job_order_.pop_front();
  }
}

std::string KernelThreads::name_of(int thread) const {
  if (const auto own = own_.find(thread); own != own_.end()) return own->second.name;
  const auto other = others_.find(thread);
  return other == others_.end() ? "thread " + std::to_string(thread) : other->second;
}

int KernelThreads::process_of(int thread) const {
  const auto own = own_.find(thread);
  return own == own_.end() ? 0 : own->second.process;
}

std::optional<int> KernelThreads::thread_named(const std::string &name, int process) const {
  if (process == 0) {
    if (processes_.size() != 1) return std::nullopt;
    process = processes_.begin()->first;
  }
  std::optional<int> only;
  for (const auto &[number, thread] : own_) {
    if (thread.process != process || thread.name != name) continue;
    if (only) return std::nullopt;
    only = number;
  }
  return only;
}

std::optional<int> KernelThreads::thread_of(TaskId task, std::uint32_t number) const {
  const auto found = jobs_.find(key_of(task, number));
  return found == jobs_.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace redag::metrics
