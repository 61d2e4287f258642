// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/event_codec.hpp"

#include <algorithm>
#include <limits>

#include "redag/loader/validate.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {
namespace {

constexpr unsigned kReasonBits = 4;  // the upper bits of the byte that has kind and reason
// Kinds from this one on have no reason. Their byte has this kind, and their distance from it as its reason.
constexpr unsigned kFirstLateKind = 15;
static_assert(static_cast<unsigned>(kLastJobEventKind) < kFirstLateKind + 16 &&
              static_cast<unsigned>(kLastReason) < 16);

// Small differences of either sign become small numbers: 0, -1, 1, -2 are 0, 1, 2, 3. Differences wrap around.
constexpr std::uint64_t fold(std::uint64_t difference) { return (difference << 1U) ^ (0 - (difference >> 63U)); }
constexpr std::uint64_t unfold(std::uint64_t number) { return (number >> 1U) ^ (0 - (number & 1U)); }

// Numbers of variable length, seven bits a byte, the lowest first (LEB128).
void put(std::uint64_t number, std::string &out) {
  while (number >= 0x80) {
    out.push_back(static_cast<char>(number | 0x80U));
    number >>= 7U;
  }
  out.push_back(static_cast<char>(number));
}

class CodeReader {
 public:
  explicit CodeReader(std::string_view code) : next_(code.data()), end_(code.data() + code.size()) {}

  bool byte(std::uint8_t &value) {
    if (next_ == end_) return false;
    value = static_cast<std::uint8_t>(*next_++);
    return true;
  }

  bool number(std::uint64_t &value) {
    value = 0;
    std::uint8_t part = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
      if (!byte(part)) return false;
      value |= std::uint64_t{part & 0x7fU} << shift;
      if ((part & 0x80U) == 0) return shift < 63 || part <= 1;
    }
    return false;
  }

  // Reads a number that was folded as a difference from `before`, and fits 32 bits.
  bool number_after(std::uint32_t before, std::uint32_t &value) {
    std::uint64_t folded = 0;
    if (!number(folded)) return false;
    const std::uint64_t sum = before + unfold(folded);
    value = static_cast<std::uint32_t>(sum);
    return sum <= std::numeric_limits<std::uint32_t>::max();
  }

  [[nodiscard]] bool at_end() const { return next_ == end_; }

 private:
  const char *next_;
  const char *end_;
};

constexpr bool is_late_kind(JobEventKind kind) { return static_cast<unsigned>(kind) >= kFirstLateKind; }

// The place of a kind in Expected::value; 3: there is none.
constexpr std::size_t place_of(JobEventKind kind) {
  switch (kind) {
    case JobEventKind::Released: return 0;
    case JobEventKind::Ready: return 1;
    case JobEventKind::Dispatched: return 2;
    default: return 3;
  }
}

}  // namespace

EventCodec::EventCodec(std::size_t tasks) : tasks_(tasks) {}

bool EventCodec::is_event(const JobEvent &event) const {
  return event.task.value < tasks_.size() && event.kind <= kLastJobEventKind && event.reason <= kLastReason &&
         (event.reason == Reason::None || !is_late_kind(event.kind)) &&
         (event.worker == WorkerId::kNoneValue || event.worker < kMaxWorkers) && has_valid_times(event);
}

void EventCodec::begin(Time base) {
  Expected first;
  first.value.fill(static_cast<std::uint64_t>(base));
  std::fill(tasks_.begin(), tasks_.end(), first);
}

std::uint64_t EventCodec::value_before(const JobEvent &event) const {
  switch (event.kind) {
    case JobEventKind::Released:
    case JobEventKind::Ready:
    case JobEventKind::Dispatched: return tasks_[event.task.value].value[place_of(event.kind)];
    case JobEventKind::Started:
    case JobEventKind::Finished:
    case JobEventKind::Aborted:
    case JobEventKind::LowMode: return static_cast<std::uint64_t>(event.time);
    default: return 0;
  }
}

void EventCodec::note(const JobEvent &event) {
  const std::size_t place = place_of(event.kind);
  if (place < 3) tasks_[event.task.value].value[place] = static_cast<std::uint64_t>(event.value);
}

void EventCodec::encode(std::span<const JobEvent> events, Time base, std::string &out) {
  begin(base);
  put(events.size(), out);
  for (const JobEvent &event : events) {
    const auto kind = static_cast<unsigned>(event.kind);
    const unsigned upper = is_late_kind(event.kind) ? kind - kFirstLateKind : static_cast<unsigned>(event.reason);
    out.push_back(static_cast<char>(std::min(kind, kFirstLateKind) | (upper << kReasonBits)));
  }
  Time time = base;
  for (const JobEvent &event : events) {
    put(fold(static_cast<std::uint64_t>(event.time) - static_cast<std::uint64_t>(time)), out);
    time = event.time;
  }
  for (const JobEvent &event : events) put(event.task.value, out);
  for (const JobEvent &event : events) {
    std::uint32_t &job = tasks_[event.task.value].job;
    put(fold(std::uint64_t{event.job} - job), out);
    job = event.job;
  }
  for (const JobEvent &event : events) {
    // No worker is 0, because the number wraps around.
    std::uint32_t &worker = tasks_[event.task.value].worker;
    put(fold(std::uint64_t{event.worker + 1} - worker), out);
    worker = event.worker + 1;
  }
  for (const JobEvent &event : events) {
    put(fold(static_cast<std::uint64_t>(event.value) - value_before(event)), out);
    note(event);
  }
}

bool EventCodec::decode(std::string_view code, Time base, std::vector<JobEvent> &events) {
  CodeReader in(code);
  std::uint64_t number = 0;
  if (!in.number(number) || number > kMostBlockEvents) return false;
  events.assign(static_cast<std::size_t>(number), {});
  begin(base);
  for (JobEvent &event : events) {
    std::uint8_t both = 0;
    if (!in.byte(both)) return false;
    const unsigned lower = both & 0xfU;
    const unsigned upper = static_cast<unsigned>(both) >> kReasonBits;
    event.kind = static_cast<JobEventKind>(lower < kFirstLateKind ? lower : lower + upper);
    event.reason = static_cast<Reason>(lower < kFirstLateKind ? upper : 0);
  }
  auto time = static_cast<std::uint64_t>(base);
  for (JobEvent &event : events) {
    if (!in.number(number)) return false;
    time += unfold(number);
    event.time = static_cast<Time>(time);
  }
  for (JobEvent &event : events) {
    if (!in.number(number) || number >= tasks_.size()) return false;
    event.task = TaskId(static_cast<std::size_t>(number));
  }
  for (JobEvent &event : events) {
    std::uint32_t &job = tasks_[event.task.value].job;
    if (!in.number_after(job, job)) return false;
    event.job = job;
  }
  for (JobEvent &event : events) {
    std::uint32_t &worker = tasks_[event.task.value].worker;
    if (!in.number_after(worker, worker)) return false;
    event.worker = worker - 1;
  }
  for (JobEvent &event : events) {
    if (!in.number(number)) return false;
    event.value = static_cast<std::int64_t>(value_before(event) + unfold(number));
    if (!is_event(event)) return false;
    note(event);
  }
  return in.at_end();
}

}  // namespace redag::trace
