// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/diagnosis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "redag_analysis/text/rounded_time.hpp"

namespace redag::doctor {
namespace {

enum class Of : std::uint8_t { Machine, Process, Ros };  // the last two: running ones

struct Setting {
  const char *name;
  Of of;
  Check *check;
  const char *why;
  const char *mend;
};

// The one home of these facts. The documentation refers to the command.
constexpr std::array kSettings = {
    Setting{
        "real-time right", Of::Machine, check_realtime_right,
        "Mode os runs callbacks on SCHED_FIFO threads with priorities up to 90. Without the right, urgent callbacks "
        "wait for slow ones.",
        "put 'USER - rtprio 95' into /etc/security/limits.d/90-realtime.conf and log in again; systemd: "
        "LimitRTPRIO=95; Docker: --ulimit rtprio=95 --cap-add=SYS_NICE; or, without ROS, sudo setcap cap_sys_nice+ep "
        "PROGRAM (its loader then ignores LD_LIBRARY_PATH)"},
    Setting{
        "memory lock", Of::Machine, check_memory_lock,
        "Memory that is not locked can be taken away, and brings page faults to callbacks. lock_memory keeps it, up "
        "to this limit.",
        "put 'USER - memlock unlimited' into /etc/security/limits.d/90-realtime.conf and log in again; systemd: "
        "LimitMEMLOCK=infinity; Docker: --ulimit memlock=-1"},
    Setting{"throttling", Of::Machine, check_throttling,
            "Above this share of a processor, real-time threads pause for the rest of the period: no bound allows for "
            "that. Without the limit, a callback that never ends keeps its processor, and your shell may get none.",
            "sudo sysctl kernel.sched_rt_runtime_us=-1; since Linux 6.12: echo 0 | sudo tee "
            "/sys/kernel/debug/sched/fair_server/cpu*/runtime"},
    Setting{
        "kernel preemption", Of::Machine, check_preemption,
        "Without PREEMPT_RT, system calls and interrupts of other programs delay callbacks, mostly by microseconds, "
        "at worst by milliseconds.",
        "install a kernel with PREEMPT_RT (Ubuntu: sudo pro enable realtime-kernel; Debian: sudo apt install "
        "linux-image-rt-amd64), or boot with preempt=full"},
    Setting{"frequency governor", Of::Machine, check_governor,
            "A processor at a lower frequency takes longer than the wcet, and raising the frequency takes time.",
            "sudo cpupower frequency-set --governor performance"},
    Setting{"C-states", Of::Machine, check_idle_states,
            "A processor that sleeps deeply starts late when a timer expires.",
            "sudo cpupower idle-set --disable-by-latency 10"},
    Setting{"SMT", Of::Machine, check_smt,
            "Two threads of a core share its units: a callback takes longer while the other thread works.",
            "echo off | sudo tee /sys/devices/system/cpu/smt/control"},
    Setting{"isolated processors", Of::Machine, check_isolation,
            "Elsewhere other programs and the kernel's own work share processors and caches with the workers.",
            "boot with isolcpus=N nohz_full=N rcu_nocbs=N, where N is the workers' processors, such as 2-3 of four, "
            "and name "
            "them to the executor (cpus, cpu_affinity)"},
    Setting{"interrupts", Of::Machine, check_interrupts,
            "An interrupt stops the callback on its processor, however urgent.",
            "sudo systemctl stop irqbalance; echo 0 | sudo tee /proc/irq/*/smp_affinity_list"},
    Setting{
        "clock source", Of::Machine, check_clock_source,
        "The executor reads the clock several times for each job. A slow source costs a system call and microseconds.",
        "sudo dmesg | grep -i tsc says why the kernel avoids it; boot with clocksource=tsc tsc=reliable"},
    Setting{"hypervisor", Of::Machine, check_steal,
            "The host can stop a virtual machine for others, and no priority within it prevents that.",
            "give the machine processors of its own on the host (virsh vcpupin), or use no virtual machine"},
    Setting{"swap", Of::Machine, check_swap,
            "Memory that was swapped out is read from the disk when a callback needs it.", "sudo swapoff --all"},
    Setting{"threads", Of::Process, check_threads,
            "The kernel lets callbacks preempt each other only on threads with such priorities.",
            "start the process with the real-time right, and preemption os or auto"},
    Setting{"middleware", Of::Ros, check_middleware,
            "These threads deliver the messages. If workers are as urgent, busy ones delay the messages of others.",
            "set raise_middleware:=true, or higher priorities in the middleware's own configuration"},
    Setting{"simulated time", Of::Ros, check_simulated_time,
            "With use_sim_time, timers follow /clock, and so the speed of a simulator.",
            "ros2 param set NODE use_sim_time false"},
    Setting{"live page", Of::Process, check_live_page,
            "The executor itself says what mode it runs in, and what was late.",
            "redag top PID shows its tasks; redag why explains the misses of a recorded run"},
};

Finding judge(const Setting &setting, const Subject &subject) {
  try {
    return setting.check(subject);
  } catch (const Unreadable &error) {
    return {Verdict::Unknown, error.what()};
  }
}

bool applies(const Setting &setting, const Subject &subject) {
  try {
    return setting.of == Of::Machine || (subject.attached && (setting.of == Of::Process || subject.is_ros()));
  } catch (const Unreadable &) {  // the check says so
    return true;
  }
}

}  // namespace

const char *to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::Green: return "green";
    case Verdict::Unknown: return "unknown";
    case Verdict::Yellow: return "yellow";
    case Verdict::Red: return "red";
  }
  return "";
}

Finding worst_of(const std::vector<Finding> &findings) {
  if (findings.empty()) return {Verdict::Unknown, "there is nothing to examine"};
  return *std::max_element(findings.begin(), findings.end(),
                           [](const Finding &a, const Finding &b) { return a.verdict < b.verdict; });
}

std::size_t Diagnosis::count(Verdict verdict) const {
  return static_cast<std::size_t>(
      std::count_if(lines.begin(), lines.end(), [&](const Line &line) { return line.finding.verdict == verdict; }));
}

Result<Diagnosis> diagnose(const Machine &machine, std::optional<std::int64_t> pid) {
  Subject subject{.machine = machine, .processes = {{"self"}}, .attached = pid.has_value()};
  Diagnosis diagnosis;
  if (pid) {
    if (machine.names_in(fmt::format("/proc/{}", *pid)).empty()) {
      return make_error(fmt::format("there is no process {}", *pid),
                        "of a container: docker inspect --format '{{.State.Pid}}' NAME");
    }
    diagnosis.processes = subject.processes = processes_with(machine, *pid);
    try {
      diagnosis.threads = subject.threads();
    } catch (const Unreadable &) {  // the line of the threads says why
    }
  }
  for (const Setting &setting : kSettings) {
    if (!applies(setting, subject)) continue;
    diagnosis.lines.push_back({setting.name, judge(setting, subject), setting.why, setting.mend});
  }
  return diagnosis;
}

Line judge(const HistogramCounts &wake_ups) {
  const Duration longest = wake_ups.longest();
  const Verdict verdict = wake_ups.total() == 0           ? Verdict::Unknown
                          : longest <= 100 * kMicrosecond ? Verdict::Green
                          : longest <= kMillisecond       ? Verdict::Yellow
                                                          : Verdict::Red;
  return {"wake-up latency",
          {verdict, fmt::format("median {}, 99 % {}, longest {}", humanize_up(wake_ups.quantile(0.5)),
                                humanize_up(wake_ups.quantile(0.99)), humanize_up(longest))},
          "Each release of a timer can be as late as a thread wakes up. Up to 100us is good, 1ms the most to bear.",
          "the lines above; then measure again, while the robot's other programs run"};
}

}  // namespace redag::doctor
