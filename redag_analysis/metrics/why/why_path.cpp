// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_path.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {

std::vector<Part> WhyPath::parts_of(const LinkedJob &job, Time begin, Time end, bool end_to_end) {
  explained_ = &job;
  end_to_end_ = end_to_end;
  walk(job, begin, end, true);
  std::vector<Part> merged;
  for (Part &part : parts_) {
    Part *last = merged.empty() ? nullptr : &merged.back();
    const bool continues = last != nullptr && last->cause == part.cause && last->job == part.job &&
                           last->by == part.by && last->begin != kNever && part.begin == last->begin + last->length;
    if (continues) {
      last->length += part.length;
    } else {
      merged.push_back(std::move(part));
    }
  }
  return merged;
}

void WhyPath::add(const LinkedJob &job, Cause cause, Time begin, Time end, JobId by) {
  if (begin < end) parts_.push_back({cause, job.id(), by, begin, end - begin});
}

void WhyPath::walk(const LinkedJob &job, Time begin, Time end, bool on_way) {
  const JobRecord &record = job.record;
  const Time release = std::clamp(record.release, begin, end);
  const Time seen = std::clamp(record.seen, release, end);
  if (begin < release) before_release(job, begin, release, on_way);
  const std::size_t first = parts_.size();
  late_release(job, release, seen);
  Time at = seen;
  Duration used = 0;
  for (const Wait &wait : job.waits) {
    if (wait.begin >= end) break;
    add(job, Cause::Unknown, at, std::min(end, wait.begin));
    at = std::max(at, wait.begin);
    const Time until = std::min(end, wait.end);
    if (wait.cause == Cause::Execution) {
      on_worker(job, wait, at, until, on_way, used);
    } else if (wait.cause == Cause::Predecessor) {
      if (at < until) wait_for_data(job, at, until, on_way);
    } else {
      add(job, wait.cause, at, until, wait.by);
    }
    at = std::max(at, until);
  }
  add(job, Cause::Unknown, at, end);
  if (!is_simulated()) measure(job, first, begin, end);
}

// The job was not released. A data task's release is the end of a predecessor; a timer's comes by itself.
void WhyPath::before_release(const LinkedJob &job, Time begin, Time end, bool on_way) {
  const bool is_timer = links_.task(job.record.task).activation == Activation::Timer;
  const LinkedJob *const last = job.last.get();
  if (!on_way) {
    if (is_timer || last == nullptr) {
      unreleased(job, begin, end);
    } else {
      wait_for_data(job, begin, end, false);
    }
    return;
  }
  const LinkedJob *const oldest = job.oldest.get();
  if (oldest == nullptr) {
    unreleased(job, begin, end);
    return;
  }
  const Time there = std::clamp(links_.end_of(*oldest), begin, end);
  if (begin < there) walk(*oldest, begin, there, true);
  if (there >= end) return;
  if (is_timer) {
    add(job, Cause::Sampling, there, end);
  } else {
    wait_for_data(job, there, end, true);
  }
}

// The explained job waited for this one. Before its own release, what its data was doing is not in the trace.
void WhyPath::unreleased(const LinkedJob &job, Time begin, Time end) {
  if (&job == explained_) return add(job, Cause::Unknown, begin, end);
  add(job, Cause::Unreleased, begin, end, job.id());
}

void WhyPath::wait_for_data(const LinkedJob &job, Time begin, Time end, bool on_way) {
  const LinkedJob *const last = job.last.get();
  if (last == nullptr) {
    add(job, Cause::Predecessor, begin, end);
    return;
  }
  const Time there = std::clamp(links_.end_of(*last), begin, end);
  const bool carries_it = end_to_end_ && last->record.origin == job.record.origin;
  if (begin < there) walk(*last, begin, there, on_way && carries_it);
  add(job, Cause::HandOver, there, end);
}

void WhyPath::late_release(const LinkedJob &job, Time begin, Time end) {
  const JobRecord &record = job.record;
  if (begin >= end) return;
  if (links_.task(record.task).activation == Activation::Data) {
    add(job, Cause::HandOver, begin, end);
    return;
  }
  add(job, Cause::ReleaseLate, begin, end);
}

// Adds what the job did in [begin, end) while it had a worker. `used` is what it has executed.
void WhyPath::on_worker(const LinkedJob &job, const Wait &wait, Time begin, Time end, bool on_way, Duration &used) {
  const Time start = std::clamp(job.record.start, wait.begin, wait.end);
  const Time finish = std::clamp(links_.end_of(job), start, wait.end);
  const Duration wcet = links_.task(job.record.task).wcet;
  Time beyond = finish;              // from when on it executed beyond its wcet
  if (is_simulated() && wcet > 0) {  // on threads measure() judges it
    beyond = start + std::clamp<Duration>(wcet - used, 0, finish - start);
    used += finish - start;
  }
  add(job, Cause::Wakeup, std::max(begin, wait.begin), std::min(end, start));
  add(job, on_way ? Cause::Execution : Cause::Predecessor, std::max(begin, start), std::min(end, beyond),
      on_way ? JobId{} : job.id());
  add(job, info_.overheads.empty() ? Cause::Overrun : Cause::Overhead, std::max(begin, beyond), std::min(end, finish));
}

// On threads the trace has the processor time of the whole body, and not when it was used. It is compared with the time
// on a worker, if [begin, end) covers all of it.
void WhyPath::measure(const LinkedJob &job, std::size_t first, Time begin, Time end) {
  const JobRecord &record = job.record;
  const JobId id = job.id();
  const auto is_own = [&](const Part &part) {
    return part.job == id && (part.cause == Cause::Execution || (part.cause == Cause::Predecessor && part.by == id));
  };
  Duration held = 0;
  for (std::size_t i = first; i < parts_.size(); ++i) held += is_own(parts_[i]) ? parts_[i].length : 0;
  const bool is_whole = record.start >= begin && links_.end_of(job) <= end && record.outcome != JobOutcome::InFlight;
  if (record.processor == kNever || !is_whole) {
    for (std::size_t i = first; i < parts_.size(); ++i) {
      if (is_own(parts_[i])) parts_[i].cause = Cause::OnWorker;
    }
    return;
  }
  const Duration wcet = links_.task(record.task).wcet;
  const Duration executed = std::min(record.processor, held);
  const Duration beyond = wcet == 0 ? 0 : std::max<Duration>(0, executed - wcet);
  const Duration idle = held - executed;
  Duration excess = beyond + idle;
  for (std::size_t i = parts_.size(); i > first && excess > 0; --i) {
    Part &part = parts_[i - 1];
    if (!is_own(part)) continue;
    const Duration taken = std::min(excess, part.length);
    part.length -= taken;
    excess -= taken;
  }
  std::erase_if(parts_, [](const Part &part) { return part.length == 0; });
  if (beyond > 0) parts_.push_back({Cause::Overrun, id, {}, kNever, beyond});
  if (idle > 0) parts_.push_back({Cause::OffProcessor, id, {}, kNever, idle});
}

}  // namespace redag::metrics
