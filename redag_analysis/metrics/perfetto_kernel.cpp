// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto_kernel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <string_view>
#include <utility>

namespace redag::metrics::perfetto {
namespace {

constexpr std::size_t kBundle = 1000;  // events of a packet
constexpr std::string_view kSoft = "softirq ";
// The kernel's numbers of its softirqs, by name (include/linux/interrupt.h).
constexpr std::array<std::string_view, 10> kSoftirqs = {"HI",       "TIMER",   "NET_TX", "NET_RX",  "BLOCK",
                                                        "IRQ_POLL", "TASKLET", "SCHED",  "HRTIMER", "RCU"};

}  // namespace

Result<void> KernelDrawing::read_until(Time time) {
  while (!is_over_ && last_ <= time) {
    const Result<std::optional<KernelRow>> row = reader_.next();
    if (!row) return tl::unexpected<Diagnostics>(row.error());
    if (!*row) {
      is_over_ = true;
      break;
    }
    add(**row);
    if (const std::optional<Time> at = time_of(**row)) last_ = *at;
  }
  return {};
}

Result<void> KernelDrawing::finish() {
  if (Result<void> read = read_until(kNever); !read) return read;
  begin();
  for (auto &[cpu, events] : events_) {
    while (!events.empty()) write(cpu, events, kBundle);
  }
  return {};
}

void KernelDrawing::add(const KernelRow &row) {
  threads_.add(row);
  if (const auto *event = std::get_if<KernelSwitch>(&row)) {
    add(*event);
  } else if (const auto *interrupt = std::get_if<KernelInterrupt>(&row)) {
    add(*interrupt);
  } else if (const auto *process = std::get_if<KernelProcess>(&row)) {
    write_process(*process);
  } else if (const auto *thread = std::get_if<KernelThread>(&row); thread != nullptr && thread->process != 0) {
    write_thread(*thread);
  }
}

void KernelDrawing::add(const KernelSwitch &event) {
  if (event.time < start_) {
    earlier_[event.cpu] = event;
    return;
  }
  begin();
  push(event.cpu, {event.time, 1, Event::Kind::Switch, event});
}

void KernelDrawing::add(const KernelInterrupt &event) {
  if (event.end < start_) return;
  begin();
  const Time entry = std::max(event.begin, start_);
  // One interrupt can end, and the next one begin, in the same microsecond, and so can both ends of a short one.
  push(event.cpu, {entry, entry < event.end ? 2 : 0, Event::Kind::Entry, event.name});
  push(event.cpu, {event.end, 0, Event::Kind::Exit, event.name});
}

void KernelDrawing::push(int cpu, Event event) {
  std::vector<Event> &events = events_[cpu];
  events.push_back(std::move(event));
  // The record has an interrupt where it ends. Half of the events wait for those that began before them.
  if (events.size() >= 2 * kBundle) write(cpu, events, kBundle);
}

// The last switch before `start` becomes one at `start`, because it tells who had the processor then.
void KernelDrawing::begin() {
  if (std::exchange(has_begun_, true)) return;
  for (const auto &[cpu, event] : earlier_) push(cpu, {start_, 1, Event::Kind::Switch, event});
}

// Writes the earliest events of one processor.
void KernelDrawing::write(int cpu, std::vector<Event> &events, std::size_t most) {
  std::stable_sort(events.begin(), events.end(), [](const Event &a, const Event &b) {
    return std::pair(a.time, a.order) < std::pair(b.time, b.order);
  });
  const std::size_t count = std::min(most, events.size());
  writer_.packet([&](Builder<TracePacket> &packet) {
    Builder<FtraceEventBundle> bundle(packet, TracePacket::FtraceEvents);
    bundle.add_uint(FtraceEventBundle::Cpu, static_cast<std::uint32_t>(cpu));
    for (const Event &one : std::span(events).first(count)) {
      Builder<FtraceEvent> event(bundle, FtraceEventBundle::Event);
      event.add_uint(FtraceEvent::Timestamp, static_cast<std::uint64_t>(one.time - start_));
      if (const auto *its = std::get_if<KernelSwitch>(&one.what)) {
        write_switch(event, *its);
      } else {
        event.add_uint(FtraceEvent::Pid, static_cast<std::uint32_t>(running_[cpu].thread));
        write_interrupt(event, std::get<std::string>(one.what), one.kind == Event::Kind::Entry);
      }
    }
  });
  writer_.flush_if_full();
  events.erase(events.begin(), events.begin() + static_cast<std::ptrdiff_t>(count));
}

void KernelDrawing::write_process(const KernelProcess &process) {
  writer_.packet([&](Builder<TracePacket> &packet) {
    Builder<ProcessTree> tree(packet, TracePacket::ProcessTree);
    Builder<Process> its(tree, ProcessTree::Processes);
    its.add_int(Process::Pid, process.process);
    its.add_text(Process::Cmdline, process.name);
  });
}

void KernelDrawing::write_thread(const KernelThread &thread) {
  writer_.packet([&](Builder<TracePacket> &packet) {
    Builder<ProcessTree> tree(packet, TracePacket::ProcessTree);
    Builder<Thread> its(tree, ProcessTree::Threads);
    its.add_int(Thread::Tid, thread.thread);
    its.add_int(Thread::Tgid, thread.process);
    its.add_text(Thread::Name, thread.name);
  });
}

std::string KernelDrawing::comm(int thread, int cpu) const {
  return thread == 0 ? fmt::format("swapper/{}", cpu) : threads_.name_of(thread);
}

void KernelDrawing::write_switch(Builder<FtraceEvent> &event, const KernelSwitch &one) {
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

void KernelDrawing::write_interrupt(Builder<FtraceEvent> &event, const std::string &name, bool begins) {
  const std::string_view soft = std::string_view(name).substr(name.rfind(kSoft, 0) == 0 ? kSoft.size() : 0);
  const auto vector = std::find(kSoftirqs.begin(), kSoftirqs.end(), soft);
  if (soft.size() < name.size() && vector != kSoftirqs.end()) {
    Builder<Softirq> its(event, begins ? FtraceEvent::SoftirqEntry : FtraceEvent::SoftirqExit);
    its.add_uint(Softirq::Vec, static_cast<std::uint32_t>(vector - kSoftirqs.begin()));
    return;
  }
  // The record has names of interrupts and no numbers. Numbers only have to differ.
  const int number = interrupt_numbers_.try_emplace(name, static_cast<int>(interrupt_numbers_.size())).first->second;
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

}  // namespace redag::metrics::perfetto
