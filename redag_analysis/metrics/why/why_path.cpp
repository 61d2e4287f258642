// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_path.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {
namespace {

constexpr const char *kTimerThread = "redag-timer";

// Cuts executed stretches where the job has used `limit`; what is beyond has cause `beyond`.
std::vector<KernelView::Stretch> cut_at(std::vector<KernelView::Stretch> stretches, Duration limit, Cause beyond,
                                        Duration &used) {
  std::vector<KernelView::Stretch> out;
  for (KernelView::Stretch &one : stretches) {
    const Duration length = one.end - one.begin;
    if (one.cause != Cause::Execution || limit == 0) {
      out.push_back(std::move(one));
      continue;
    }
    const Duration within = std::clamp<Duration>(limit - used, 0, length);
    used += length;
    if (within > 0) out.push_back({Cause::Execution, {}, one.begin, one.begin + within});
    if (within < length) out.push_back({beyond, {}, one.begin + within, one.end});
  }
  return out;
}

}  // namespace

std::vector<Part> WhyPath::parts_of(const LinkedJob &job, Time begin, Time end, bool end_to_end) {
  explained_ = &job;
  end_to_end_ = end_to_end;
  walk(job, begin, end, true);
  std::vector<Part> merged;
  for (Part &part : parts_) {
    Part *last = merged.empty() ? nullptr : &merged.back();
    const bool continues = last != nullptr && last->cause == part.cause && last->job == part.job &&
                           last->by == part.by && last->program == part.program && last->begin != kNever &&
                           part.begin == last->begin + last->length;
    if (continues) {
      last->length += part.length;
    } else {
      merged.push_back(std::move(part));
    }
  }
  return merged;
}

void WhyPath::add(const LinkedJob &job, const Stretch &stretch, Time begin, Time end, JobId by) {
  begin = std::max(begin, stretch.begin);
  end = std::min(end, stretch.end);
  if (begin < end) parts_.push_back({stretch.cause, job.id(), by, stretch.program, begin, end - begin});
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
    add(job, {Cause::Unknown, {}, at, wait.begin}, at, end);
    at = std::max(at, wait.begin);
    const Time until = std::min(end, wait.end);
    if (wait.cause == Cause::Execution) {
      for (const Stretch &stretch : on_worker(job, wait, used)) {
        if (stretch.cause == Cause::Execution && !on_way) {
          add(job, {Cause::Predecessor, {}, stretch.begin, stretch.end}, at, until, job.id());
        } else {
          add(job, stretch, at, until);
        }
      }
    } else if (wait.cause == Cause::Predecessor) {
      if (at < until) wait_for_data(job, at, until, on_way);
    } else {
      add(job, {wait.cause, {}, at, until}, at, until, wait.by);
    }
    at = std::max(at, until);
  }
  add(job, {Cause::Unknown, {}, at, end}, at, end);
  if (!is_simulated() && !thread_of(job)) measure(job, first, begin, end);
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
    add(job, {Cause::Sampling, {}, there, end}, there, end);
  } else {
    wait_for_data(job, there, end, true);
  }
}

// The explained job waited for this one. Before its own release, what its data was doing is not in the trace.
void WhyPath::unreleased(const LinkedJob &job, Time begin, Time end) {
  if (&job == explained_) return add(job, {Cause::Unknown, {}, begin, end}, begin, end);
  add(job, {Cause::Unreleased, {}, begin, end}, begin, end, job.id());
}

void WhyPath::wait_for_data(const LinkedJob &job, Time begin, Time end, bool on_way) {
  const LinkedJob *const last = job.last.get();
  if (last == nullptr) {
    add(job, {Cause::Predecessor, {}, begin, end}, begin, end);
    return;
  }
  const Time there = std::clamp(links_.end_of(*last), begin, end);
  const bool carries_it = end_to_end_ && last->record.origin == job.record.origin;
  if (begin < there) walk(*last, begin, there, on_way && carries_it);
  add(job, {Cause::HandOver, {}, there, end}, there, end);
}

void WhyPath::late_release(const LinkedJob &job, Time begin, Time end) {
  const JobRecord &record = job.record;
  if (begin >= end) return;
  if (links_.task(record.task).activation == Activation::Data) {
    add(job, {Cause::HandOver, {}, begin, end}, begin, end);
    return;
  }
  const std::optional<int> timer = kernel_ == nullptr ? std::nullopt : kernel_->thread_named(kTimerThread);
  if (!timer) {
    add(job, {Cause::ReleaseLate, {}, begin, end}, begin, end);
    return;
  }
  for (Stretch stretch : kernel_->before(*timer, record.release, record.seen)) {
    if (stretch.cause == Cause::Unknown) stretch.cause = Cause::ReleaseLate;
    add(job, stretch, begin, end);
  }
}

std::optional<int> WhyPath::thread_of(const LinkedJob &job) const {
  if (kernel_ == nullptr || job.record.start == kNever) return std::nullopt;
  return kernel_->thread_of(job.record.start, links_.end_of(job), job.record.processor);
}

// What the job did while it had a worker. `used` is what it has executed.
std::vector<KernelView::Stretch> WhyPath::on_worker(const LinkedJob &job, const Wait &wait, Duration &used) const {
  const JobRecord &record = job.record;
  const Time start = std::clamp(record.start, wait.begin, wait.end);
  const Time end = std::clamp(links_.end_of(job), start, wait.end);
  const std::optional<int> thread = thread_of(job);
  std::vector<Stretch> out;
  if (wait.begin < start) {
    if (thread) {
      for (Stretch stretch : kernel_->before(*thread, wait.begin, start)) {
        if (stretch.cause == Cause::Unknown) stretch.cause = Cause::Wakeup;
        out.push_back(std::move(stretch));
      }
    } else {
      out.push_back({Cause::Wakeup, {}, wait.begin, start});
    }
  }
  std::vector<Stretch> body{{Cause::Execution, {}, start, end}};
  if (thread) body = kernel_->follow(*thread, start, end);
  if (!is_simulated() && !thread) {  // measure() judges it
    out.insert(out.end(), body.begin(), body.end());
    return out;
  }
  const Cause beyond = is_simulated() && !info_.overheads.empty() ? Cause::Overhead : Cause::Overrun;
  body = cut_at(std::move(body), links_.task(record.task).wcet, beyond, used);
  out.insert(out.end(), body.begin(), body.end());
  return out;
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
  if (beyond > 0) parts_.push_back({Cause::Overrun, id, {}, {}, kNever, beyond});
  if (idle > 0) parts_.push_back({Cause::OffProcessor, id, {}, {}, kNever, idle});
}

}  // namespace redag::metrics
