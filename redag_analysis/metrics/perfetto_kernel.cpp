// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto_kernel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

namespace redag::metrics::perfetto {
namespace {

constexpr std::size_t kBundle = 1000;  // events of a packet
constexpr int kOrdinary = 120;         // the kernel's priority of a thread with nice value 0, and of the idle one
constexpr std::string_view kSoft = "softirq ";
// The kernel's numbers of its softirqs, by name (include/linux/interrupt.h).
constexpr std::array<std::string_view, 10> kSoftirqs = {"HI",       "TIMER",   "NET_TX", "NET_RX",  "BLOCK",
                                                        "IRQ_POLL", "TASKLET", "SCHED",  "HRTIMER", "RCU"};

/// An event of a processor: where it stands in the record, and when it happened.
struct Place {
  enum class Kind : std::uint8_t { Exit, Switch, Entry };  // in the order of those of one time

  int cpu = 0;
  Time time = 0;
  Kind kind = Kind::Switch;
  std::size_t index = 0;
};

// The events from `start` on, by processor and time. The last switch before `start` becomes one at `start`, because it
// tells who had the processor then.
std::vector<Place> places_of(const KernelRecord &record, Time start) {
  std::vector<Place> places;
  std::map<int, std::size_t> earlier;  // by processor
  for (std::size_t i = 0; i < record.switches.size(); ++i) {
    const KernelSwitch &one = record.switches[i];
    if (one.time < start) {
      earlier[one.cpu] = i;
    } else {
      places.push_back({one.cpu, one.time, Place::Kind::Switch, i});
    }
  }
  for (const auto &[cpu, i] : earlier) places.push_back({cpu, start, Place::Kind::Switch, i});
  for (std::size_t i = 0; i < record.interrupts.size(); ++i) {
    const KernelInterrupt &one = record.interrupts[i];
    if (one.end < start) continue;
    places.push_back({one.cpu, std::max(one.begin, start), Place::Kind::Entry, i});
    places.push_back({one.cpu, one.end, Place::Kind::Exit, i});
  }
  std::sort(places.begin(), places.end(), [](const Place &a, const Place &b) {
    return std::tie(a.cpu, a.time, a.kind, a.index) < std::tie(b.cpu, b.time, b.kind, b.index);
  });
  return places;
}

class KernelEvents {
 public:
  KernelEvents(PacketWriter &writer, const KernelRecord &record, Time start)
      : writer_(writer), record_(record), start_(start) {}

  // Writes events of one processor.
  void write(std::span<const Place> places) {
    writer_.packet([&](Builder<TracePacket> &packet) {
      Builder<FtraceEventBundle> bundle(packet, TracePacket::FtraceEvents);
      bundle.add_uint(FtraceEventBundle::Cpu, static_cast<std::uint32_t>(places.front().cpu));
      for (const Place &place : places) {
        Builder<FtraceEvent> event(bundle, FtraceEventBundle::Event);
        event.add_uint(FtraceEvent::Timestamp, static_cast<std::uint64_t>(place.time - start_));
        if (place.kind == Place::Kind::Switch) {
          add_switch(event, record_.switches[place.index]);
        } else {
          event.add_uint(FtraceEvent::Pid, static_cast<std::uint32_t>(running_[place.cpu].thread));
          add_interrupt(event, record_.interrupts[place.index].name, place.kind == Place::Kind::Entry);
        }
      }
    });
    writer_.flush_if_full();
  }

 private:
  struct Running {
    int thread = 0;
    int priority = kOrdinary;
  };

  [[nodiscard]] std::string comm(int thread, int cpu) const {
    return thread == 0 ? fmt::format("swapper/{}", cpu) : thread_name(record_, thread);
  }

  void add_switch(Builder<FtraceEvent> &event, const KernelSwitch &one) {
    Running &running = running_[one.cpu];
    event.add_uint(FtraceEvent::Pid, static_cast<std::uint64_t>(one.from));
    Builder<SchedSwitch> its(event, FtraceEvent::SchedSwitch);
    its.add_text(SchedSwitch::PrevComm, comm(one.from, one.cpu));
    its.add_int(SchedSwitch::PrevPid, one.from);
    its.add_int(SchedSwitch::PrevPrio, running.thread == one.from ? running.priority : kOrdinary);
    its.add_int(SchedSwitch::PrevState, one.runnable ? 0 : 1);  // TASK_RUNNING, TASK_INTERRUPTIBLE
    its.add_text(SchedSwitch::NextComm, comm(one.to, one.cpu));
    its.add_int(SchedSwitch::NextPid, one.to);
    its.add_int(SchedSwitch::NextPrio, one.to_priority);
    running = {one.to, one.to_priority};
  }

  void add_interrupt(Builder<FtraceEvent> &event, const std::string &name, bool begins) {
    const std::string_view soft = std::string_view(name).substr(name.rfind(kSoft, 0) == 0 ? kSoft.size() : 0);
    const auto vector = std::find(kSoftirqs.begin(), kSoftirqs.end(), soft);
    if (soft.size() < name.size() && vector != kSoftirqs.end()) {
      Builder<Softirq> its(event, begins ? FtraceEvent::SoftirqEntry : FtraceEvent::SoftirqExit);
      its.add_uint(Softirq::Vec, static_cast<std::uint32_t>(vector - kSoftirqs.begin()));
      return;
    }
    // The record has names of interrupts and no numbers. Numbers only have to differ.
    const int number = numbers_.try_emplace(name, static_cast<int>(numbers_.size())).first->second;
    if (begins) {
      Builder<IrqHandlerEntry> its(event, FtraceEvent::IrqHandlerEntry);
      its.add_int(IrqHandlerEntry::Irq, number);
      its.add_text(IrqHandlerEntry::Name, name);
    } else {
      Builder<IrqHandlerExit> its(event, FtraceEvent::IrqHandlerExit);
      its.add_int(IrqHandlerExit::Irq, number);
      its.add_int(IrqHandlerExit::Ret, 1);  // handled
    }
  }

  PacketWriter &writer_;
  const KernelRecord &record_;
  Time start_;
  std::map<int, Running> running_;  // by processor
  std::map<std::string, int> numbers_;
};

void write_processes(PacketWriter &writer, const KernelRecord &record, const std::string &program) {
  const int process = process_of(record);
  if (process == 0) return;
  writer.packet([&](Builder<TracePacket> &packet) {
    Builder<ProcessTree> tree(packet, TracePacket::ProcessTree);
    {
      Builder<Process> its(tree, ProcessTree::Processes);
      its.add_int(Process::Pid, process);
      its.add_text(Process::Cmdline, program);
    }
    for (const int thread : record.own) {
      Builder<Thread> its(tree, ProcessTree::Threads);
      its.add_int(Thread::Tid, thread);
      its.add_int(Thread::Tgid, process);
      its.add_text(Thread::Name, thread_name(record, thread));
    }
  });
}

}  // namespace

int process_of(const KernelRecord &record) { return record.own.empty() ? 0 : *record.own.begin(); }

std::string thread_name(const KernelRecord &record, int thread) {
  const auto known = record.names.find(thread);
  return known == record.names.end() ? fmt::format("thread {}", thread) : known->second;
}

void write_kernel(PacketWriter &writer, const KernelRecord &record, Time start, const std::string &program) {
  write_processes(writer, record, program);
  const std::vector<Place> places = places_of(record, start);
  KernelEvents events(writer, record, start);
  for (std::size_t from = 0; from < places.size();) {
    std::size_t to = from;
    while (to < places.size() && to - from < kBundle && places[to].cpu == places[from].cpu) ++to;
    events.write(std::span(places).subspan(from, to - from));
    from = to;
  }
}

}  // namespace redag::metrics::perfetto
