// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why_kernel.hpp"

#include <algorithm>

namespace redag::metrics {
namespace {

// Returns the first slice that ends after `time`.
template <class Slices>
auto first_after(const Slices &slices, Time time) {
  return std::upper_bound(slices.begin(), slices.end(), time,
                          [](Time value, const auto &slice) { return value < slice.end; });
}

void push(std::vector<KernelView::Stretch> &out, Cause cause, std::string program, Time begin, Time end) {
  if (begin < end) out.push_back({cause, std::move(program), begin, end});
}

}  // namespace

KernelView::KernelView(const KernelRecord &record) : record_(record) {
  for (const JobThread &job : record.jobs) jobs_.emplace(JobId{job.task, job.number}, job.thread);
  std::map<int, KernelSwitch> current;  // by processor: what began
  for (const KernelSwitch &event : record.switches) {
    if (const auto before = current.find(event.cpu); before != current.end() && before->second.to == event.from) {
      const KernelSwitch &began = before->second;
      by_cpu_[event.cpu].push_back({began.time, event.time, event.cpu, began.to, began.to_priority, event.runnable});
    }
    current[event.cpu] = event;
  }
  for (const auto &[cpu, slices] : by_cpu_) {
    for (const Slice &slice : slices) by_thread_[slice.thread].push_back(slice);
  }
  for (auto &[thread, slices] : by_thread_) {
    std::sort(slices.begin(), slices.end(), [](const Slice &a, const Slice &b) { return a.begin < b.begin; });
  }
  for (const KernelInterrupt &interrupt : record.interrupts) interrupts_[interrupt.cpu].push_back(&interrupt);
}

std::optional<int> KernelView::thread_of(const JobId &job) const {
  const auto found = jobs_.find(job);
  return found == jobs_.end() ? std::nullopt : std::optional(found->second);
}

std::vector<int> KernelView::threads_named(const std::string &name) const {
  std::vector<int> threads;
  for (const int thread : record_.own) {
    if (const auto found = record_.names.find(thread); found != record_.names.end() && found->second == name) {
      threads.push_back(thread);
    }
  }
  return threads;
}

std::string KernelView::name_of(int thread) const {
  const auto found = record_.names.find(thread);
  return found == record_.names.end() ? "thread " + std::to_string(thread) : found->second;
}

std::vector<KernelView::Stretch> KernelView::follow(int thread, Time begin, Time end) const {
  std::vector<Stretch> out;
  const auto found = by_thread_.find(thread);
  if (found == by_thread_.end()) {
    push(out, Cause::Unknown, {}, begin, end);
    return out;
  }
  const std::vector<Slice> &slices = found->second;
  auto slice = first_after(slices, begin);
  Time at = begin;
  while (at < end) {
    const Time next = slice == slices.end() ? end : std::min(end, slice->begin);
    if (at < next) {  // it had no processor
      if (slice == slices.begin() || slice == slices.end()) {
        push(out, Cause::Unknown, {}, at, next);
      } else if (const Slice &last = *(slice - 1); last.runnable) {
        occupants(last.cpu, last.priority, at, next, out);
      } else {
        push(out, Cause::Slept, {}, at, next);
      }
      at = next;
    }
    if (slice == slices.end()) break;
    executed(*slice, at, std::min(end, slice->end), out);
    at = std::max(at, std::min(end, slice->end));
    ++slice;
  }
  return out;
}

std::vector<KernelView::Stretch> KernelView::before(int thread, Time begin, Time end) const {
  std::vector<Stretch> out;
  const auto found = by_thread_.find(thread);
  if (found == by_thread_.end() || found->second.front().begin > end) {
    push(out, Cause::Unknown, {}, begin, end);
    return out;
  }
  const auto next = std::upper_bound(found->second.begin(), found->second.end(), end,
                                     [](Time value, const Slice &one) { return value < one.begin; });
  const Slice &slice = *(next - 1);
  const Time until = std::clamp(slice.begin, begin, end);
  occupants(slice.cpu, slice.priority, begin, until, out);
  for (Stretch &one : out) {
    // When the thread was woken is not recorded: one that would have given way to it at once proves nothing.
    if (one.cause != Cause::OtherProgram) one = {Cause::Unknown, {}, one.begin, one.end};
  }
  push(out, Cause::Unknown, {}, until, end);
  return out;
}

// What ran on a processor that a thread of this priority could have used.
void KernelView::occupants(int cpu, int priority, Time begin, Time end, std::vector<Stretch> &out) const {
  const auto found = by_cpu_.find(cpu);
  Time at = begin;
  if (found != by_cpu_.end()) {
    for (auto slice = first_after(found->second, begin); slice != found->second.end() && slice->begin < end; ++slice) {
      push(out, Cause::Unknown, {}, at, std::max(at, slice->begin));
      const Time from = std::max(at, slice->begin);
      const Time to = std::min(end, slice->end);
      const bool throttled = is_realtime_priority(priority) && !is_realtime_priority(slice->priority);
      const Cause cause = slice->thread == 0                    ? Cause::Unknown
                          : record_.own.contains(slice->thread) ? Cause::OwnThread
                          : throttled                           ? Cause::Throttled
                                                                : Cause::OtherProgram;
      push(out, cause, cause == Cause::Unknown ? std::string() : name_of(slice->thread), from, to);
      at = std::max(at, to);
    }
  }
  push(out, Cause::Unknown, {}, at, end);
}

// The part of a slice in which its thread executed, cut at interrupts.
void KernelView::executed(const Slice &slice, Time begin, Time end, std::vector<Stretch> &out) const {
  Time at = begin;
  if (const auto found = interrupts_.find(slice.cpu); found != interrupts_.end()) {
    const auto &all = found->second;
    auto one = std::upper_bound(all.begin(), all.end(), begin,
                                [](Time value, const KernelInterrupt *interrupt) { return value < interrupt->end; });
    for (; one != all.end() && (*one)->begin < end; ++one) {
      const Time from = std::max(at, (*one)->begin);
      const Time to = std::min(end, (*one)->end);
      push(out, Cause::Execution, {}, at, from);
      push(out, Cause::Interrupt, (*one)->name, from, to);
      at = std::max(at, to);
    }
  }
  push(out, Cause::Execution, {}, at, end);
}

}  // namespace redag::metrics
