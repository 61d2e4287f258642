// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/system.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>

#include "redag/base/cpu_list.hpp"
#include "redag/base/lines.hpp"
#include "redag/live/process.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::robot {
namespace {

namespace fs = std::filesystem;

// The kernel's struct sched_attr in its first form. Headers of C libraries before glibc 2.41 do not have it.
struct Attributes {
  std::uint32_t size = sizeof(Attributes);
  std::uint32_t policy = 0;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime = 0;
  std::uint64_t deadline = 0;
  std::uint64_t period = 0;
};
static_assert(sizeof(Attributes) == 48, "SCHED_ATTR_SIZE_VER0");

constexpr std::uint64_t kResetOnFork = 1;  // SCHED_FLAG_RESET_ON_FORK
constexpr std::uint32_t kDeadline = 6;     // SCHED_DEADLINE

std::string first_line(const std::string &path) {
  const std::string text = live::text_of_proc(path);
  return text.substr(0, text.find('\n'));
}

std::optional<std::int64_t> number(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Returns the folders of `place` whose names are numbers, ascending.
std::vector<std::int64_t> numbers_in(const std::string &place) {
  std::vector<std::int64_t> found;
  std::error_code error;
  for (fs::directory_iterator entry(place, error), end; !error && entry != end; entry.increment(error)) {
    if (const auto value = number(entry->path().filename().string())) found.push_back(*value);
  }
  std::sort(found.begin(), found.end());
  return found;
}

Scheduling::Class class_of(std::uint32_t policy) {
  switch (policy) {
    case SCHED_FIFO: return Scheduling::Class::Fifo;
    case SCHED_RR: return Scheduling::Class::RoundRobin;
    case SCHED_BATCH: return Scheduling::Class::Batch;
    case SCHED_IDLE: return Scheduling::Class::Idle;
    case kDeadline: return Scheduling::Class::Deadline;
    default: return Scheduling::Class::Other;
  }
}

std::uint32_t policy_of(Scheduling::Class kind) {
  switch (kind) {
    case Scheduling::Class::Fifo: return SCHED_FIFO;
    case Scheduling::Class::RoundRobin: return SCHED_RR;
    case Scheduling::Class::Batch: return SCHED_BATCH;
    case Scheduling::Class::Idle: return SCHED_IDLE;
    case Scheduling::Class::Deadline: return kDeadline;
    case Scheduling::Class::Other: break;
  }
  return SCHED_OTHER;
}

std::optional<Scheduling> scheduling_of(pid_t tid) {
  Attributes attributes;
  if (syscall(SYS_sched_getattr, tid, &attributes, sizeof(attributes), 0U) != 0) return std::nullopt;
  Scheduling scheduling{.kind = class_of(attributes.policy),
                        .priority = static_cast<int>(attributes.priority),
                        .nice = attributes.nice,
                        .resets_on_fork = (attributes.flags & kResetOnFork) != 0};
  // For ordinary threads, Linux 6.12 and later put a time slice in the same place.
  if (scheduling.kind == Scheduling::Class::Deadline) {
    scheduling.budget = static_cast<Duration>(attributes.runtime);
    scheduling.deadline = static_cast<Duration>(attributes.deadline);
    scheduling.period = static_cast<Duration>(attributes.period);
  }
  return scheduling;
}

std::optional<std::vector<int>> affinity_of(pid_t tid) {
  // Machines can have more processors than a cpu_set_t, which the kernel then refuses.
  cpu_set_t *const set = CPU_ALLOC(kMaxCpu + 1);
  if (set == nullptr) return std::nullopt;
  const std::size_t size = CPU_ALLOC_SIZE(kMaxCpu + 1);
  CPU_ZERO_S(size, set);
  std::optional<std::vector<int>> cpus;
  if (sched_getaffinity(tid, size, set) == 0) {
    cpus.emplace();
    for (int cpu = 0; cpu <= kMaxCpu; ++cpu) {
      if (CPU_ISSET_S(static_cast<std::size_t>(cpu), size, set)) cpus->push_back(cpu);
    }
  }
  CPU_FREE(set);
  return cpus;
}

bool set_affinity(pid_t tid, const std::vector<int> &cpus) {
  cpu_set_t *const set = CPU_ALLOC(kMaxCpu + 1);
  if (set == nullptr) return false;
  const std::size_t size = CPU_ALLOC_SIZE(kMaxCpu + 1);
  CPU_ZERO_S(size, set);
  for (const int cpu : cpus) CPU_SET_S(static_cast<std::size_t>(cpu), size, set);
  const bool is_set = sched_setaffinity(tid, size, set) == 0;
  const int error = errno;
  CPU_FREE(set);
  errno = error;
  return is_set;
}

bool set_scheduling(pid_t tid, const Scheduling &wanted) {
  Attributes attributes;
  attributes.policy = policy_of(wanted.kind);
  attributes.flags = wanted.resets_on_fork ? kResetOnFork : 0;
  attributes.nice = wanted.nice;
  attributes.priority = static_cast<std::uint32_t>(wanted.priority);
  attributes.runtime = static_cast<std::uint64_t>(wanted.budget);
  attributes.deadline = static_cast<std::uint64_t>(wanted.deadline);
  attributes.period = static_cast<std::uint64_t>(wanted.period);
  return syscall(SYS_sched_setattr, tid, &attributes, 0U) == 0;
}

std::string hint_for(const Scheduling &refused, int error) {
  if (refused.kind != Scheduling::Class::Deadline) return error == EPERM ? runtime::realtime_hint() : "";
  if (error == EPERM) return "a reservation needs root or CAP_SYS_NICE, and a thread that may run on all processors";
  if (error != EBUSY) return "";
  return "all reservations together may have the share of each processor that real-time threads have "
         "(/proc/sys/kernel/sched_rt_runtime_us)";
}

std::string described(const ThreadId &thread, const std::string &name) {
  return fmt::format("thread '{}' ({} of process {})", name, thread.tid, thread.pid);
}

}  // namespace

std::string to_string(const Scheduling &scheduling) {
  switch (scheduling.kind) {
    case Scheduling::Class::Fifo: return fmt::format("FIFO {}", scheduling.priority);
    case Scheduling::Class::RoundRobin: return fmt::format("RR {}", scheduling.priority);
    case Scheduling::Class::Batch: return fmt::format("batch, nice {}", scheduling.nice);
    case Scheduling::Class::Idle: return "idle";
    case Scheduling::Class::Deadline:
      return fmt::format("{} every {}", format_duration(scheduling.budget), format_duration(scheduling.period));
    case Scheduling::Class::Other: break;
  }
  return fmt::format("nice {}", scheduling.nice);
}

bool is_same_level(const Scheduling &a, const Scheduling &b) {
  return a.kind == b.kind && a.priority == b.priority && a.nice == b.nice && a.budget == b.budget &&
         a.deadline == b.deadline && a.period == b.period;
}

std::optional<std::uint64_t> System::start_of(std::int64_t pid, std::int64_t tid) const {
  return live::start_time_in(live::text_of_proc(fmt::format("{}/{}/task/{}/stat", proc_, pid, tid)));
}

std::optional<ThreadState> System::state_of(const ThreadId &thread) const {
  if (start_of(thread.pid, thread.tid) != thread.start) return std::nullopt;
  const auto tid = static_cast<pid_t>(thread.tid);
  const auto scheduling = scheduling_of(tid);
  auto cpus = affinity_of(tid);
  if (!scheduling || !cpus) return std::nullopt;
  return ThreadState{*scheduling, *std::move(cpus)};
}

std::vector<LiveThread> System::threads_of(std::int64_t pid) const {
  std::vector<LiveThread> threads;
  for (const std::int64_t tid : numbers_in(fmt::format("{}/{}/task", proc_, pid))) {
    const auto start = start_of(pid, tid);
    if (!start) continue;
    const ThreadId id{pid, tid, *start};
    auto state = state_of(id);
    if (!state) continue;
    threads.push_back(
        LiveThread{id, first_line(fmt::format("{}/{}/task/{}/comm", proc_, pid, tid)), *std::move(state)});
  }
  return threads;
}

Snapshot System::read() const {
  Snapshot snapshot;
  snapshot.cpus = parse_cpu_list(first_line("/sys/devices/system/cpu/online")).value_or(std::vector<int>{});
  for (const std::int64_t pid : numbers_in(proc_)) {
    if (pid == getpid()) continue;
    const std::string place = fmt::format("{}/{}/", proc_, pid);
    LiveProcess process;
    process.pid = pid;
    process.name = first_line(place + "comm");
    process.command = live::text_of_proc(place + "cmdline");
    while (!process.command.empty() && process.command.back() == '\0') process.command.pop_back();
    std::replace(process.command.begin(), process.command.end(), '\0', ' ');
    // The hierarchy of version 2 is "0::/path". Others come before it, such as "4:memory:/path".
    const std::string groups = live::text_of_proc(place + "cgroup");
    const std::size_t unified = groups.rfind("0::");
    const std::size_t path = unified == std::string::npos ? groups.find('/') : unified + 3;
    if (path != std::string::npos) process.cgroup = groups.substr(path, groups.find('\n', path) - path);
    process.threads = threads_of(pid);
    if (!process.threads.empty()) snapshot.processes.push_back(std::move(process));
  }
  snapshot.interrupts = interrupts();
  return snapshot;
}

// A line is "  24:   123   0  IR-PCI-MSI 524288-edge      eth0-rx, eth0-tx". Lines of the processors' own interrupts
// begin with letters. What stands between the counts and the name differs between machines.
std::vector<LiveInterrupt> System::interrupts() const {
  std::vector<LiveInterrupt> found;
  const std::string text = live::text_of_proc(proc_ + "/interrupts");
  std::string_view rest = text;
  if (!rest.empty()) static_cast<void>(next_line(rest));  // the heading
  while (!rest.empty()) {
    const std::string line(next_line(rest));
    const std::size_t colon = line.find(':');
    const std::size_t begin = line.find_first_not_of(' ');
    if (colon == std::string::npos || begin >= colon) continue;
    const auto irq = number(std::string_view(line).substr(begin, colon - begin));
    if (!irq) continue;
    std::istringstream words(line.substr(colon + 1));
    std::string name;
    for (std::string word; words >> word;) {
      if (name.empty() && number(word)) continue;  // a count
      name += (name.empty() ? "" : " ") + word;
    }
    auto cpus = cpus_of(static_cast<int>(*irq));
    if (cpus) found.push_back(LiveInterrupt{static_cast<int>(*irq), std::move(name), *std::move(cpus)});
  }
  return found;
}

std::optional<std::vector<int>> System::cpus_of(int interrupt) const {
  return parse_cpu_list(first_line(fmt::format("{}/irq/{}/smp_affinity_list", proc_, interrupt)));
}

Result<void> System::set(const ThreadId &thread, const std::string &name, const ThreadState &wanted) const {
  const std::optional<ThreadState> now = state_of(thread);
  if (!now) return {};
  const auto tid = static_cast<pid_t>(thread.tid);
  const auto schedule = [&]() -> Result<void> {
    if (now->scheduling == wanted.scheduling || set_scheduling(tid, wanted.scheduling) || errno == ESRCH) return {};
    const int error = errno;
    return make_error(fmt::format("{} cannot get {}: {}", described(thread, name), to_string(wanted.scheduling),
                                  std::strerror(error)),
                      hint_for(wanted.scheduling, error));
  };
  // The kernel pins no thread that has a reservation.
  const bool had_reservation = now->scheduling.kind == Scheduling::Class::Deadline;
  if (had_reservation) {
    if (Result<void> done = schedule(); !done) return done;
  }
  if (now->cpus != wanted.cpus && !set_affinity(tid, wanted.cpus) && errno != ESRCH) {
    return make_error(fmt::format("{} cannot run on processors {} only: {}", described(thread, name),
                                  format_cpu_list(wanted.cpus), std::strerror(errno)),
                      errno == EINVAL ? "does the machine have them, and may this thread use them?"
                                      : "run as root, or with CAP_SYS_NICE");
  }
  // The kernel leaves out processors that the machine, or the thread's cpuset, does not have.
  if (const auto cpus = affinity_of(tid); cpus && *cpus != wanted.cpus) {
    return make_error(fmt::format("{} runs on processors {} and not on {}", described(thread, name),
                                  format_cpu_list(*cpus), format_cpu_list(wanted.cpus)),
                      "does the machine have them, and its cpuset?");
  }
  return had_reservation ? Result<void>() : schedule();
}

Result<void> System::set_cpus(int interrupt, const std::vector<int> &cpus) const {
  errno = 0;
  std::ofstream file(fmt::format("{}/irq/{}/smp_affinity_list", proc_, interrupt));
  file << format_cpu_list(cpus) << '\n' << std::flush;
  if (file) return {};
  return make_error(fmt::format("interrupt {} cannot be served by processors {} only: {}", interrupt,
                                format_cpu_list(cpus), std::strerror(errno)),
                    errno == EIO ? "this interrupt cannot be moved" : "run as root");
}

std::optional<std::string> System::environment_of(std::int64_t pid, const std::string &name) const {
  const std::string text = '\0' + live::text_of_proc(fmt::format("{}/{}/environ", proc_, pid));
  const std::size_t at = text.find('\0' + name + '=');
  if (at == std::string::npos) return std::nullopt;
  const std::size_t begin = at + name.size() + 2;
  return text.substr(begin, text.find('\0', begin) - begin);
}

std::string System::boot() const { return first_line(proc_ + "/sys/kernel/random/boot_id"); }

}  // namespace redag::robot
