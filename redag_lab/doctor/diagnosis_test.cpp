// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/diagnosis.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <rapidcheck/gtest.h>

#include "redag/base/text.hpp"
#include "redag/live/writer.hpp"

namespace redag::doctor {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string limits(const char *rtprio, const char *memlock) {
  return fmt::format(
      "Limit                     Soft Limit           Hard Limit           Units\n"
      "Max locked memory         {0:<20} {0:<20} bytes\n"
      "Max realtime priority     {1:<20} {1:<20}\n",
      memlock, rtprio);
}

std::string stat_of(const char *name, int policy, int priority) {
  std::string text = fmt::format("7 ({}) S", name);
  for (int field = 4; field < 40; ++field) text += " 0";
  return text + fmt::format(" {} {} 0\n", priority, policy);
}

// /proc and /sys of some machine, as a folder.
class FakeMachine {
 public:
  FakeMachine() {
    std::string name = (fs::temp_directory_path() / "doctor.XXXXXX").string();
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    root_ = name;
  }
  ~FakeMachine() { fs::remove_all(root_); }
  FakeMachine(const FakeMachine &) = delete;
  FakeMachine &operator=(const FakeMachine &) = delete;

  [[nodiscard]] fs::path path(const std::string &file) const { return root_ / file; }

  void write(const std::string &file, const std::string &text) const {
    fs::create_directories(path(file).parent_path());
    std::ofstream(path(file), std::ios::binary) << text;
  }

  void write_thread(const std::string &process, int id, const std::string &stat, const char *cpus) const {
    const std::string folder = fmt::format("proc/{}/task/{}/", process, id);
    write(folder + "stat", stat);
    write(folder + "status", fmt::format("Name:\tx\nCpus_allowed:\tf\nCpus_allowed_list:\t{}\n", cpus));
  }

  void write_process(const std::string &id, const char *space) const {
    const std::string folder = "proc/" + id + "/";
    write(folder + "limits", limits("95", "unlimited"));
    write(folder + "status", "Name:\tx\nNSpid:\t" + id + "\nVmSwap:\t       0 kB\nCapEff:\t0000000000000000\n");
    write(folder + "uid_map", "         0          0 4294967295\n");
    write(folder + "cmdline", std::string("robot\0", 6));
    fs::create_directories(path(folder + "ns"));
    fs::create_symlink(space, path(folder + "ns/pid"));
    write_thread(id, 7, stat_of("robot", 0, 0), "2-3");
  }

  [[nodiscard]] Diagnosis diagnose(std::optional<std::int64_t> pid = {}) const {
    Result<Diagnosis> diagnosis = doctor::diagnose(Machine(root_.string()), pid);
    EXPECT_TRUE(diagnosis) << to_string(diagnosis.error());
    return diagnosis ? *std::move(diagnosis) : Diagnosis();
  }

  [[nodiscard]] Finding find(const std::string &line, std::optional<std::int64_t> pid = {}) const {
    for (const Line &each : diagnose(pid).lines) {
      if (each.name == line) return each.finding;
    }
    return {Verdict::Unknown, "no such line"};
  }

 private:
  fs::path root_;
};

const std::string kItsFiles = std::string("proc/100/") + "root";  // as the process sees them
const std::string kCpu2 = "sys/devices/system/cpu/cpu2/";
const std::string kCpu3 = "sys/devices/system/cpu/cpu3/";
const std::string kIdle = "cpuidle/state1/";

// Each file of a machine without a fault, and the line that needs it.
struct File {
  std::string path;
  std::string text;
  std::string line;
};

std::vector<File> good_files() {
  const std::string self = "proc/self/";
  return {{"proc/sys/kernel/osrelease", "6.6.30-rt30\n", "throttling"},
          {"proc/sys/kernel/sched_rt_runtime_us", "-1\n", "throttling"},
          {"proc/sys/kernel/sched_rt_period_us", "1000000\n", "throttling"},
          {"proc/sys/kernel/version", "#1 SMP PREEMPT_RT Mon Nov 23 2026\n", "kernel preemption"},
          {"sys/devices/system/cpu/isolated", "2-3\n", "isolated processors"},
          {kCpu2 + "cpufreq/scaling_governor", "performance\n", "frequency governor"},
          {kCpu3 + "cpufreq/scaling_governor", "performance\n", "frequency governor"},
          {kCpu2 + kIdle + "latency", "10\n", "C-states"},
          {kCpu3 + kIdle + "latency", "10\n", "C-states"},
          {kCpu2 + kIdle + "disable", "0\n", "C-states"},
          {kCpu3 + kIdle + "disable", "0\n", "C-states"},
          {"sys/devices/system/cpu/smt/active", "0\n", "SMT"},
          {"proc/irq/24/effective_affinity_list", "0-1\n", "interrupts"},
          {"sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n", "clock source"},
          {"proc/stat", "cpu  100 0 50 900 0 0 0 0 0 0\ncpu0 100 0 50 900 0 0 0 0 0 0\n", "hypervisor"},
          {"proc/cpuinfo", "processor\t: 0\nflags\t\t: fpu vme\n", "hypervisor"},
          {"proc/swaps", "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n", "swap"},
          {self + "limits", limits("95", "unlimited"), "real-time right"}};
}

std::unique_ptr<FakeMachine> good_machine() {
  auto machine = std::make_unique<FakeMachine>();
  machine->write_process("self", "pid:[1]");
  for (const File &file : good_files()) machine->write(file.path, file.text);
  return machine;
}

TEST(Doctor, AMachineWithoutAFaultIsGreen) {
  const Diagnosis diagnosis = good_machine()->diagnose();
  EXPECT_EQ(diagnosis.lines.size(), 12U);
  for (const Line &line : diagnosis.lines) {
    EXPECT_EQ(line.finding.verdict, Verdict::Green) << line.name << ": " << line.finding.found;
  }
}

TEST(Doctor, EachFaultHasItsColour) {
  struct Fault {
    std::string path;
    std::string text;
    std::string line;
    Verdict verdict;
    std::string found;
  };
  const std::string clock = "sys/devices/system/clocksource/clocksource0/current_clocksource";
  const std::string swaps = good_files()[16].text + "/dev/sda2 partition 1024 0 -2\n";
  for (const Fault &fault : std::vector<Fault>{
           {"proc/self/limits", limits("0", "8388608"), "real-time right", Verdict::Red, "not allowed"},
           {"proc/self/limits", limits("50", "8388608"), "real-time right", Verdict::Yellow, "SCHED_FIFO up to 50"},
           {"proc/self/limits", limits("95", "8388608"), "memory lock", Verdict::Yellow, "8192 kB"},
           {"proc/sys/kernel/sched_rt_runtime_us", "950000\n", "throttling", Verdict::Yellow, "950ms of each 1s"},
           {"proc/sys/kernel/sched_rt_runtime_us", "0\n", "throttling", Verdict::Red, ""},
           {"proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC x\n", "kernel preemption", Verdict::Yellow, ""},
           {"proc/sys/kernel/version", "#1 SMP x\n", "kernel preemption", Verdict::Yellow, "voluntary or none"},
           {"sys/devices/system/cpu/isolated", "\n", "isolated processors", Verdict::Yellow, "no processor"},
           {kCpu3 + "cpufreq/scaling_governor", "powersave\n", "frequency governor", Verdict::Yellow,
            "'powersave' on processors 3"},
           {kCpu2 + kIdle + "latency", "133\n", "C-states", Verdict::Yellow, "up to 133 us to wake up on processors 2"},
           {"sys/devices/system/cpu/smt/active", "1\n", "SMT", Verdict::Yellow, "several"},
           {"proc/irq/25/effective_affinity_list", "3\n", "interrupts", Verdict::Yellow, "1 of 2 interrupts"},
           {clock, "hpet\n", "clock source", Verdict::Red, "hpet"},
           {clock, "xen\n", "clock source", Verdict::Yellow, "xen"},
           {"proc/stat", "cpu  100 0 50 800 0 0 0 50 0 0\n", "hypervisor", Verdict::Red, "took 5.0 %"},
           {"proc/cpuinfo", "flags\t\t: fpu hypervisor\n", "hypervisor", Verdict::Yellow, "took"},
           {"proc/swaps", swaps, "swap", Verdict::Yellow, "1 area"}}) {
    const auto machine = good_machine();
    machine->write(fault.path, fault.text);
    const Finding finding = machine->find(fault.line);
    EXPECT_EQ(finding.verdict, fault.verdict) << fault.line << ": " << finding.found;
    EXPECT_THAT(finding.found, HasSubstr(fault.found));
  }
}

TEST(Doctor, WhatCannotBeReadIsNotGreen) {
  const std::vector<std::string> hostile = {"-",
                                            "\x1b[2J\n",
                                            "99999999999999999999\n",
                                            "1e9\n",
                                            "on\n",
                                            std::string("\0\0\n", 3),
                                            std::string(std::size_t{5} << 20U, '0') + "\n"};
  for (const File &file : good_files()) {
    const auto expect_not_green = [&](const FakeMachine &machine, const std::string &damage) {
      const Finding finding = machine.find(file.line);
      EXPECT_NE(finding.verdict, Verdict::Green) << file.path << " " << damage.substr(0, 20) << ": " << finding.found;
      EXPECT_EQ(find_unprintable(finding.found), "");
      EXPECT_NE(finding.found, "");
    };
    const auto machine = good_machine();
    for (const std::string &text : hostile) {
      machine->write(file.path, text);
      expect_not_green(*machine, text);
    }
    for (std::size_t size = 0; size < file.text.size(); ++size) {
      if (size > 0 && file.text[size - 1] == '\n') continue;  // whole lines cannot be told from a whole file
      machine->write(file.path, file.text.substr(0, size));
      expect_not_green(*machine, "cut off");
    }
    fs::remove(machine->path(file.path));
    expect_not_green(*machine, "removed");
    fs::create_directory(machine->path(file.path));
    expect_not_green(*machine, "a folder");
  }
}

RC_GTEST_PROP(Doctor, NoContentOfFilesDisturbsIt, (std::vector<std::pair<unsigned, std::string>> damages)) {
  const std::vector<File> files = good_files();
  const auto machine = good_machine();
  machine->write_process("100", "pid:[1]");
  std::vector<std::string> paths{"proc/100/limits", "proc/100/status", "proc/100/cmdline", "proc/100/task/7/stat",
                                 "proc/100/task/7/status"};
  for (const File &file : files) paths.push_back(file.path);
  std::map<std::string, bool> cut_off;  // by line
  for (const auto &[index, text] : damages) {
    const std::size_t i = index % paths.size();
    machine->write(paths[i], text);
    if (i >= 5) cut_off[files[i - 5].line] = text.empty() || (text.back() != '\n' && text.back() != '\0');
  }
  (void)machine->diagnose(100);
  for (const Line &line : machine->diagnose().lines) {
    RC_ASSERT(find_unprintable(line.finding.found).empty());
    if (const auto damaged = cut_off.find(line.name); damaged != cut_off.end() && damaged->second) {
      RC_ASSERT(line.finding.verdict != Verdict::Green);
    }
  }
}

TEST(Doctor, AnEmptyMachineIsUnknown) {
  const FakeMachine machine;
  for (const Line &line : machine.diagnose().lines) {
    EXPECT_EQ(line.finding.verdict, Verdict::Unknown) << line.name << ": " << line.finding.found;
  }
}

TEST(Doctor, KernelsSince612HaveADeadlineServer) {
  const auto machine = good_machine();
  machine->write("proc/sys/kernel/osrelease", "6.12.0\n");
  EXPECT_EQ(machine->find("throttling").verdict, Verdict::Unknown) << "only root sees it";
  const std::string folder = "sys/kernel/debug/sched/fair_server/cpu0/";
  machine->write(folder + "period", "1000000000\n");
  machine->write(folder + "runtime", "50000000\n");
  EXPECT_EQ(machine->find("throttling").verdict, Verdict::Yellow);
  EXPECT_THAT(machine->find("throttling").found, HasSubstr("50ms of each 1s"));
  machine->write(folder + "runtime", "0\n");
  EXPECT_EQ(machine->find("throttling").verdict, Verdict::Green);
}

TEST(Doctor, ACapabilityCountsOutsideRootlessContainers) {
  const auto machine = good_machine();
  machine->write("proc/self/limits", limits("0", "0"));
  machine->write("proc/self/status", "CapEff:\t000001ffffffffff\n");
  EXPECT_EQ(machine->find("real-time right").verdict, Verdict::Green);
  EXPECT_EQ(machine->find("memory lock").verdict, Verdict::Green);
  machine->write("proc/self/uid_map", "         0       1000          1\n");
  EXPECT_EQ(machine->find("real-time right").verdict, Verdict::Red);
  fs::remove(machine->path("proc/self/uid_map"));
  EXPECT_EQ(machine->find("real-time right").verdict, Verdict::Unknown);
}

// ---- running processes ----

TEST(Attach, ThereIsNoSuchProcess) {
  const Result<Diagnosis> diagnosis = diagnose(Machine(good_machine()->path("").string()), 100);
  ASSERT_FALSE(diagnosis);
  EXPECT_EQ(diagnosis.error().front().message, "there is no process 100");
}

TEST(Attach, ItsThreadsAndTheirProcessorsCount) {
  const auto machine = good_machine();
  machine->write_process("100", "pid:[1]");
  EXPECT_EQ(machine->find("threads", 100).verdict, Verdict::Yellow);
  machine->write_thread("100", 8, stat_of("a) (b", 1, 90), "2-3");
  machine->write_thread("100", 9, stat_of("redag-0", 1, 80), "1");
  EXPECT_EQ(machine->find("threads", 100).found, "2 of 3 have a real-time priority");
  EXPECT_EQ(machine->find("isolated processors", 100).found, "processors 2-3; workers: 1-3");
  EXPECT_EQ(machine->find("interrupts", 100).verdict, Verdict::Yellow) << "processor 1 has one";
  const Diagnosis diagnosis = machine->diagnose(100);
  ASSERT_EQ(diagnosis.threads.size(), 3U);
  EXPECT_EQ(diagnosis.threads[1].name, "a) (b");
  EXPECT_EQ(diagnosis.threads[1].policy, 1);
  EXPECT_THAT(diagnosis.threads[1].cpus, ElementsAre(2, 3));
  fs::remove(machine->path("proc/100/task/9/stat"));
  EXPECT_EQ(machine->find("threads", 100).verdict, Verdict::Unknown);
  EXPECT_EQ(machine->find("interrupts", 100).verdict, Verdict::Unknown);
}

TEST(Attach, TheMiddlewareIsAboveTheWorkers) {
  const auto machine = good_machine();
  machine->write_process("100", "pid:[1]");
  EXPECT_EQ(machine->find("middleware", 100).found, "no such line") << "no ROS program";
  machine->write("proc/100/cmdline", std::string("robot\0--ros-args\0", 17));
  EXPECT_EQ(machine->find("middleware", 100).verdict, Verdict::Unknown);
  machine->write_thread("100", 8, stat_of("redag-12", 1, 80), "2");
  machine->write_thread("100", 9, stat_of("recvUC", 0, 0), "2");
  machine->write("proc/100/cmdline", std::string("robot\0", 6));
  EXPECT_EQ(machine->find("middleware", 100).verdict, Verdict::Red);
  EXPECT_EQ(machine->find("middleware", 100).found, "recvUC has priority 0, workers up to 80");
  machine->write_thread("100", 9, stat_of("recvUC", 1, 90), "2");
  EXPECT_EQ(machine->find("middleware", 100).verdict, Verdict::Green);
}

TEST(Attach, SimulatedTimeIsSeenOnTheCommandLineAndInFiles) {
  const auto machine = good_machine();
  machine->write_process("100", "pid:[1]");
  EXPECT_EQ(machine->find("simulated time", 100).found, "no such line") << "no ROS program";
  machine->write("proc/100/cmdline", std::string("robot\0--ros-args\0--params-file\0/p.yaml\0", 39));
  EXPECT_EQ(machine->find("simulated time", 100).verdict, Verdict::Unknown) << "a node may set it";
  machine->write(kItsFiles + "/p.yaml", "/**:\n  ros__parameters:\n    use_sim_time: true\n");
  EXPECT_EQ(machine->find("simulated time", 100).verdict, Verdict::Yellow);
  machine->write("proc/100/cmdline", std::string("robot\0--ros-args\0-p\0use_sim_time:=true\0", 39));
  EXPECT_EQ(machine->find("simulated time", 100).verdict, Verdict::Yellow);
}

TEST(Attach, MemoryThatIsSwappedOutIsRed) {
  const auto machine = good_machine();
  machine->write_process("100", "pid:[1]");
  machine->write("proc/swaps", "Filename Type Size Used Priority\n/dev/sda2 partition 1024 9 -2\n");
  EXPECT_EQ(machine->find("swap", 100).verdict, Verdict::Yellow);
  machine->write("proc/100/status", "VmSwap:\t      12 kB\nCapEff:\t0\n");
  EXPECT_EQ(machine->find("swap", 100).found, "12 kB of process 100 are out");
  EXPECT_EQ(machine->find("swap", 100).verdict, Verdict::Red);
}

TEST(Attach, AContainerIsAllItsProcesses) {
  const auto machine = good_machine();
  for (const char *id : {"100", "101", "102"})
    machine->write_process(id, id == std::string("102") ? "pid:[1]" : "pid:[2]");
  machine->write("proc/101/limits", limits("0", "0"));
  const Diagnosis diagnosis = machine->diagnose(100);
  ASSERT_EQ(diagnosis.processes.size(), 2U);
  EXPECT_EQ(diagnosis.processes[1].id, "101");
  EXPECT_EQ(machine->find("real-time right", 100).verdict, Verdict::Red) << "of 101";
  EXPECT_EQ(machine->find("real-time right", 102).verdict, Verdict::Green);
}

TEST(Attach, ItsLivePageSpeaks) {
  const auto machine = good_machine();
  machine->write_process("100", "pid:[2]");
  EXPECT_EQ(machine->find("live page", 100).verdict, Verdict::Unknown);
  machine->write("proc/100/status", fmt::format("NSpid:\t100\t{}\n", ::getpid()));
  const fs::path folder = machine->path(kItsFiles + "/dev/shm");
  fs::create_directories(folder);
  const auto writer = live::PageWriter::create(folder.string());
  ASSERT_TRUE(writer);
  live::Frame frame;
  frame.name = "cart";
  frame.preemption = "os";
  frame.workers = 2;
  frame.dags = {{.name = "fast"}};
  frame.dags[0].figures.released = 10;
  (*writer)->publish(frame);
  EXPECT_EQ(machine->find("live page", 100).found, "cart: preemption os, 2 workers, misses: none");
  EXPECT_EQ(machine->find("live page", 100).verdict, Verdict::Green);
  frame.dags[0].figures.misses = 1;
  (*writer)->publish(frame);
  EXPECT_EQ(machine->find("live page", 100).verdict, Verdict::Yellow);
  frame.alert = "a deadlock";
  (*writer)->publish(frame);
  EXPECT_EQ(machine->find("live page", 100).verdict, Verdict::Red);
  EXPECT_THAT(machine->find("live page", 100).found, HasSubstr("a deadlock"));
}

TEST(WakeUpLatency, ItsLongestValueCounts) {
  Histogram latencies;
  EXPECT_EQ(judge(latencies.counts()).finding.verdict, Verdict::Unknown);
  latencies.add(20 * kMicrosecond);
  EXPECT_EQ(judge(latencies.counts()).finding.verdict, Verdict::Green);
  latencies.add(200 * kMicrosecond);
  EXPECT_EQ(judge(latencies.counts()).finding.verdict, Verdict::Yellow);
  latencies.add(2 * kMillisecond);
  EXPECT_EQ(judge(latencies.counts()).finding.verdict, Verdict::Red);
}

}  // namespace
}  // namespace redag::doctor
