// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/base/time.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/doctor/checks.hpp"

namespace redag::doctor {
namespace {

constexpr const char *kCpu = "/sys/devices/system/cpu/";

template <std::size_t N>
bool is_one_of(const std::array<std::string_view, N> &names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Judges the workers' processors one by one. Those with the worst finding are named.
template <class Judge>
Finding on_each_processor(const Subject &subject, const Judge &judge) {
  std::vector<Finding> findings;
  std::map<std::string, std::vector<int>> processors;  // by what was found
  for (const int cpu : subject.cpus()) {
    findings.push_back(judge(fmt::format("{}cpu{}/", kCpu, cpu)));
    processors[findings.back().found].push_back(cpu);
  }
  Finding worst = worst_of(findings);
  worst.found += fmt::format(" on processors {}", format_cpu_list(processors[worst.found]));
  return worst;
}

std::string share_text(std::int64_t runtime, std::int64_t period, Duration unit) {
  return fmt::format("{} of each {}", format_duration(runtime * unit), format_duration(period * unit));
}

// Kernels since 6.12 have no throttling, but a deadline server on each processor.
Finding judge_deadline_servers(const Machine &machine) {
  const std::string folder = "/sys/kernel/debug/sched/fair_server/";
  std::vector<Finding> servers;
  for (const std::string &cpu : machine.names_in(folder)) {
    const std::int64_t runtime = machine.number(folder + cpu + "/runtime");
    const std::string share = share_text(runtime, machine.number(folder + cpu + "/period"), kNanosecond);
    servers.push_back(runtime == 0 ? Finding{Verdict::Green, "ordinary threads get no time of real-time threads"}
                                   : Finding{Verdict::Yellow, "ordinary threads get " + share});
  }
  if (servers.empty()) throw Unreadable(folder + " cannot be read (root may, with debugfs)");
  return worst_of(servers);
}

// "6.12.3-generic" -> {6, 12}.
std::pair<int, int> version_in(const std::string &release) {
  std::pair<int, int> version;
  const char *const end = release.data() + release.size();
  const auto major = std::from_chars(release.data(), end, version.first);
  const bool has_minor = major.ec == std::errc() && major.ptr != end && *major.ptr == '.';
  if (!has_minor || std::from_chars(major.ptr + 1, end, version.second).ec != std::errc()) {
    throw Unreadable(in_quotes(release) + " is no release of Linux");
  }
  return version;
}

}  // namespace

Finding check_throttling(const Subject &subject) {
  const Machine &machine = subject.machine;
  if (version_in(machine.text("/proc/sys/kernel/osrelease")) >= std::pair(6, 12)) {
    return judge_deadline_servers(machine);
  }
  const std::int64_t runtime = machine.number("/proc/sys/kernel/sched_rt_runtime_us");
  const std::int64_t period = machine.number("/proc/sys/kernel/sched_rt_period_us");
  if (runtime < 0 || runtime >= period) return {Verdict::Green, "real-time threads may use whole processors"};
  return {runtime == 0 ? Verdict::Red : Verdict::Yellow,
          "real-time threads get " + share_text(runtime, period, kMicrosecond)};
}

Finding check_preemption(const Subject &subject) {
  const Machine &machine = subject.machine;
  const std::string version = machine.text("/proc/sys/kernel/version");
  const auto has = [&](const char *word) { return version.find(word) != std::string::npos; };
  if (has("PREEMPT_RT") || has("PREEMPT RT")) return {Verdict::Green, "PREEMPT_RT"};
  if (!has("PREEMPT")) return {Verdict::Yellow, "voluntary or none"};
  if (!has("PREEMPT_DYNAMIC")) return {Verdict::Yellow, "full, without PREEMPT_RT"};
  try {
    const std::string model = machine.text("/sys/kernel/debug/sched/preempt");  // "none voluntary (full)"
    const std::size_t open = model.find('(') + 1;
    return {Verdict::Yellow, "PREEMPT_DYNAMIC, " + in_quotes(model.substr(open, model.find(')') - open))};
  } catch (const Unreadable &) {  // only root may
    return {Verdict::Yellow, "PREEMPT_DYNAMIC, without PREEMPT_RT"};
  }
}

Finding check_governor(const Subject &subject) {
  return on_each_processor(subject, [&](const std::string &cpu) -> Finding {
    const std::string governor = subject.machine.text(cpu + "cpufreq/scaling_governor");
    return {governor == "performance" ? Verdict::Green : Verdict::Yellow, in_quotes(governor)};
  });
}

Finding check_idle_states(const Subject &subject) {
  constexpr std::int64_t kLongest = 10;  // us
  return on_each_processor(subject, [&](const std::string &cpu) -> Finding {
    std::int64_t longest = -1;
    for (const std::string &state : subject.machine.names_in(cpu + "cpuidle")) {
      const std::string folder = fmt::format("{}cpuidle/{}", cpu, state);
      const std::int64_t latency = subject.machine.number(folder + "/latency");
      if (subject.machine.number(folder + "/disable") == 0) longest = std::max(longest, latency);
    }
    if (longest < 0) throw Unreadable(cpu + "cpuidle shows no state (the hardware or a host decides)");
    return {longest <= kLongest ? Verdict::Green : Verdict::Yellow, fmt::format("up to {} us to wake up", longest)};
  });
}

Finding check_smt(const Subject &subject) {
  if (subject.machine.number(std::string(kCpu) + "smt/active") == 0) return {Verdict::Green, "one thread a core"};
  return {Verdict::Yellow, "several threads a core"};
}

Finding check_isolation(const Subject &subject) {
  const std::vector<int> isolated = subject.machine.processors(std::string(kCpu) + "isolated");
  if (isolated.empty()) return {Verdict::Yellow, "no processor is kept free of other work"};
  const std::vector<int> cpus = subject.cpus();
  const bool all = std::includes(isolated.begin(), isolated.end(), cpus.begin(), cpus.end());
  return {all ? Verdict::Green : Verdict::Yellow,
          fmt::format("processors {}; workers: {}", format_cpu_list(isolated), format_cpu_list(cpus))};
}

Finding check_interrupts(const Subject &subject) {
  const std::vector<int> cpus = subject.cpus();
  std::uint64_t count = 0;
  std::uint64_t there = 0;
  for (const std::string &number : subject.machine.names_in("/proc/irq")) {
    if (!number_in(number)) continue;  // default_smp_affinity
    ++count;
    const std::vector<int> to = subject.machine.processors("/proc/irq/" + number + "/effective_affinity_list");
    if (std::find_first_of(to.begin(), to.end(), cpus.begin(), cpus.end()) != to.end()) ++there;
  }
  if (count == 0) throw Unreadable("/proc/irq shows no interrupt");
  return {there > 0 ? Verdict::Yellow : Verdict::Green,
          fmt::format("{} of {} on processors {}", there, plural(count, "interrupt"), format_cpu_list(cpus))};
}

Finding check_clock_source(const Subject &subject) {
  constexpr std::array<std::string_view, 4> kGood{"tsc", "arch_sys_counter", "kvm-clock",
                                                  "hyperv_clocksource_tsc_page"};
  constexpr std::array<std::string_view, 5> kSlow{"hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit"};
  const auto source = subject.machine.text("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  return {is_one_of(kGood, source)   ? Verdict::Green
          : is_one_of(kSlow, source) ? Verdict::Red
                                     : Verdict::Yellow,
          in_quotes(source)};
}

Finding check_steal(const Subject &subject) {
  constexpr std::size_t kSteal = 7;  // user, nice, system, idle, iowait, irq, softirq, steal
  constexpr double kMuch = 0.001;
  const std::vector<std::string> words = words_of(subject.machine.value("/proc/stat", "cpu "));
  double total = 0;
  double steal = 0;
  for (std::size_t i = 0; i <= kSteal; ++i) {
    const auto ticks = i < words.size() ? number_in(words[i]) : std::nullopt;
    if (!ticks || *ticks < 0) throw Unreadable("/proc/stat: the times of the processors are no numbers");
    steal = static_cast<double>(*ticks);
    total += steal;
  }
  const double share = total > 0 ? steal / total : 0;
  const std::string taken = fmt::format("the host took {} of the time so far", format_percent(share));
  if (share >= kMuch) return {Verdict::Red, taken};
  // Processors of ARM have no such flag.
  const std::string flags = subject.machine.value("/proc/cpuinfo", "flags");
  if (steal > 0 || flags.find(" hypervisor") != std::string::npos) return {Verdict::Yellow, taken};
  return {Verdict::Green, "none"};
}

Finding check_swap(const Subject &subject) {
  const std::string swaps = subject.machine.text("/proc/swaps");
  if (swaps.substr(0, 8) != "Filename") throw Unreadable("/proc/swaps has another form than expected");
  const auto areas = static_cast<std::uint64_t>(std::count(swaps.begin(), swaps.end(), '\n'));
  if (areas == 0) return {Verdict::Green, "none"};
  std::vector<Finding> findings{{Verdict::Yellow, plural(areas, "area")}};
  for (const Process &process : subject.processes) {
    const std::vector<std::string> words = words_of(subject.machine.value(process.file("status"), "VmSwap:"));
    const std::int64_t amount = words.empty() ? 0 : number_in(words[0]).value_or(0);
    if (amount > 0) findings.push_back({Verdict::Red, fmt::format("{} kB of process {} are out", amount, process.id)});
  }
  return worst_of(findings);
}

}  // namespace redag::doctor
