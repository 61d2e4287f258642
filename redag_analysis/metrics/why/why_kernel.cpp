// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_kernel.hpp"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <variant>

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

Result<void> KernelView::read_until(Time time) {
  // Times of the kernel can be whole microseconds.
  constexpr Duration kBeyond = kMillisecond;
  const Time until = time > kNever - kBeyond ? kNever : time + kBeyond;
  while (!is_over_ && last_ <= until) {
    const Result<std::optional<KernelRow>> row = reader_.next();
    if (!row) return tl::unexpected<Diagnostics>(row.error());
    if (!*row) {
      end();
      break;
    }
    if (const auto *one = std::get_if<KernelSwitch>(&**row)) {
      add(*one);
    } else {
      const KernelInterrupt &interrupt = std::get<KernelInterrupt>(**row);
      interrupts_[interrupt.cpu].push_back(interrupt);
      ++kept_;
    }
    last_ = time_of(**row);
    if (!begun_) begun_ = first_ = last_;
    if (kept_ > kMostKept) forget();
  }
  return {};
}

void KernelView::add(const KernelSwitch &event) {
  Slices &slices = by_cpu_[event.cpu];
  if (!slices.empty() && slices.back().end == kNever) {
    const bool is_whole = slices.back().thread == event.from;  // else the kernel dropped the end of this slice
    if (const auto own = by_thread_.find(slices.back().thread); own != by_thread_.end()) {
      end_last(own->second, event, is_whole);
    }
    end_last(slices, event, is_whole);
  }
  slices.push_back({.begin = event.time, .cpu = event.cpu, .thread = event.to, .priority = event.to_priority});
  ++kept_;
  if (event.to != 0) names_[event.to] = event.to_name;
  if (!is_own(event.to)) return;
  by_thread_[event.to].push_back(slices.back());
  ++kept_;
}

// Ends the slice that goes on on the processor of `event`, or removes it.
void KernelView::end_last(Slices &slices, const KernelSwitch &event, bool is_whole) {
  const auto open = std::find_if(slices.rbegin(), slices.rend(),
                                 [&](const Slice &slice) { return slice.cpu == event.cpu && slice.end == kNever; });
  if (open == slices.rend()) return;
  open->end = event.time;
  open->runnable = event.runnable;
  if (!is_whole) slices.erase(std::next(open).base());
}

// Slices go on as far as the record does.
void KernelView::end() {
  is_over_ = true;
  for (auto *all : {&by_cpu_, &by_thread_}) {
    for (auto &[key, slices] : *all) {
      for (Slice &slice : slices) slice.end = std::min(slice.end, last_);
    }
  }
}

// Forgets the older half of the time that is kept.
void KernelView::forget() {
  const Time middle = *first_ + (last_ - *first_) / 2;
  const auto trim = [&](auto &all) {
    for (auto &[key, kept] : all) {
      while (!kept.empty() && kept.front().end < middle) {
        kept.pop_front();
        --kept_;
      }
    }
  };
  trim(by_cpu_);
  trim(by_thread_);
  trim(interrupts_);
  first_ = middle;
}

// Threads of executors have names of their own: "redag-0", "redag-timer". That of `redag run` is "redag".
bool KernelView::is_own(int thread) const {
  const auto found = names_.find(thread);
  return found != names_.end() && (found->second == "redag" || found->second.starts_with("redag-"));
}

std::optional<int> KernelView::thread_of(Time begin, Time end, Duration processor) const {
  constexpr Duration kResolution = kMicrosecond;
  const auto runs_at = [](const Slices &slices, Time at) {
    const auto slice = first_after(slices, at - kResolution - 1);
    return slice != slices.end() && slice->begin <= at + kResolution;
  };
  const auto time_on = [&](const Slices &slices) {
    Duration sum = 0;
    for (auto slice = first_after(slices, begin); slice != slices.end() && slice->begin < end; ++slice) {
      sum += std::min(end, slice->end) - std::max(begin, slice->begin);
    }
    return sum;
  };
  std::vector<int> found;
  for (const auto &[thread, slices] : by_thread_) {
    const auto name = names_.find(thread);
    const bool is_worker = name != names_.end() && name->second.starts_with("redag-") &&
                           name->second.find_first_not_of("0123456789", 6) == std::string::npos;
    if (is_worker && runs_at(slices, begin) && runs_at(slices, end)) found.push_back(thread);
  }
  if (found.size() > 1 && processor != kNever) {
    const Duration tolerance = 20 * kMicrosecond + processor / 50;
    std::erase_if(found, [&](int thread) { return std::abs(time_on(by_thread_.at(thread)) - processor) > tolerance; });
  }
  return found.size() == 1 ? std::optional(found.front()) : std::nullopt;
}

std::optional<int> KernelView::thread_named(const std::string &name) const {
  std::optional<int> only;
  for (const auto &[thread, slices] : by_thread_) {
    const auto found = names_.find(thread);
    if (found == names_.end() || found->second != name) continue;
    if (only) return std::nullopt;
    only = thread;
  }
  return only;
}

std::vector<KernelView::Stretch> KernelView::follow(int thread, Time begin, Time end) const {
  std::vector<Stretch> out;
  const auto found = by_thread_.find(thread);
  if (found == by_thread_.end()) {
    push(out, Cause::Unknown, {}, begin, end);
    return out;
  }
  const Slices &slices = found->second;
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
  if (found == by_thread_.end() || found->second.empty() || found->second.front().begin > end) {
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
      const Cause cause = slice->thread == 0      ? Cause::Unknown
                          : is_own(slice->thread) ? Cause::OwnThread
                          : throttled             ? Cause::Throttled
                                                  : Cause::OtherProgram;
      std::string program;
      if (cause != Cause::Unknown) {
        const auto name = names_.find(slice->thread);
        program = name == names_.end() ? "thread" : name->second;
        if (cause != Cause::OwnThread) program += "-" + std::to_string(slice->thread);
      }
      push(out, cause, std::move(program), from, to);
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
    for (auto one = first_after(all, begin); one != all.end() && one->begin < end; ++one) {
      const Time from = std::max(at, one->begin);
      const Time to = std::min(end, one->end);
      push(out, Cause::Execution, {}, at, from);
      push(out, Cause::Interrupt, one->name, from, to);
      at = std::max(at, to);
    }
  }
  push(out, Cause::Execution, {}, at, end);
}

}  // namespace redag::metrics
