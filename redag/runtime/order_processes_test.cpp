// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Processes that share one order, come, change their rates, and are killed at random. After each such change, the
// kernel's priorities of all living ones must agree again. Their jobs wait instead of computing.
// REDAG_ORDER_CHAOS=600 goes on for that many seconds, and prints how long agreement took.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <thread>
#include <vector>

#include "redag/derived/rng.hpp"
#include "redag/engine/engine.hpp"
#include "redag/live/order_page.hpp"
#include "redag/live/process.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

constexpr Duration kLongEnough = 100 * kSecond;
constexpr int kJobs = 3;

using Periods = std::array<int, kJobs>;  // ms

/// Runs in a process of its own: an engine with a job in progress for each task. Each thread is named after its task,
/// "task0". Reads new periods from `commands` until it is killed.
[[noreturn]] void run_member(const std::string &folder, const PriorityBand &band, Periods periods, int commands) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  Workload workload;
  std::vector<Body> bodies;
  std::vector<testing::TestTask> tasks;
  Event never;
  for (int i = 0; i < kJobs; ++i) {
    tasks.push_back({.name = fmt::format("t{}", i), .period = periods[static_cast<std::size_t>(i)]});
    bodies.emplace_back([&never, i](const Job &) {
      pthread_setname_np(pthread_self(), fmt::format("task{}", i).c_str());
      never.wait();
      return sched::Outcome::Finished;
    });
  }
  workload.dags.push_back(testing::make_dag("d", tasks));
  EngineOptions options;
  // As many workers as tasks: every job is in progress, whatever its period.
  options.config = make_config(Mode{PreemptionMode::Os, {}}, kJobs, workload.policy, band, kJobs);
  options.band = band;
  options.band.shared = true;
  options.order_folder = folder;
  Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  engine.bind(workload, std::move(bodies));
  if (!engine.start()) ::_exit(1);
  engine.set_origin(monotonic_now());
  for (std::size_t i = 0; i < kJobs; ++i) engine.release(TaskId(i), engine.now());
  while (::read(commands, periods.data(), sizeof(periods)) == static_cast<ssize_t>(sizeof(periods))) {
    for (std::size_t i = 0; i < kJobs; ++i) {
      engine.set_timing(TaskId(i), periods[i] * kMillisecond, periods[i] * kMillisecond);
    }
  }
  ::_exit(0);
}

struct SharingProcess {
  pid_t pid = 0;
  int commands = -1;
  Periods periods{};
};

/// Returns the SCHED_FIFO priority of each task's thread, as the kernel has it.
std::map<std::string, int> priorities_of(pid_t pid) {
  std::map<std::string, int> priorities;
  std::error_code gone;
  for (const auto &entry : std::filesystem::directory_iterator(fmt::format("/proc/{}/task", pid), gone)) {
    const std::string stat = live::text_of_proc(entry.path().string() + "/stat");
    const std::size_t open = stat.find('(');
    const std::size_t close = stat.rfind(')');
    if (open == std::string::npos || close == std::string::npos) continue;
    std::size_t at = close;
    for (int field = 2; field < 40 && at != std::string::npos; ++field) at = stat.find(' ', at + 1);
    if (at == std::string::npos) continue;
    priorities[stat.substr(open + 1, close - open - 1)] = std::atoi(stat.c_str() + at);
  }
  return priorities;
}

class OrderOfProcesses : public ::testing::Test {
 protected:
  OrderOfProcesses() {
    std::string name = ::testing::TempDir() + "redag_order_XXXXXX";
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void SetUp() override {
    if (band_.top_job < 40) GTEST_SKIP() << "this process may use too few SCHED_FIFO priorities: " << realtime_hint();
    bool is_real = false;
    Result<ThreadHandle> probe = start_thread({"probe", 1, {}}, [&] { is_real = sched_getscheduler(0) == SCHED_FIFO; });
    ASSERT_TRUE(probe);
    probe->join();
    if (!is_real) GTEST_SKIP() << "threads have their priorities in name only (a build with sanitizers)";
  }
  void TearDown() override {
    while (!members_.empty()) kill(0);
    std::filesystem::remove_all(folder_);
  }

  void come() {
    SharingProcess member;
    member.periods = any_periods();
    std::array<int, 2> ends{};
    ASSERT_EQ(::pipe(ends.data()), 0);
    member.pid = ::fork();
    ASSERT_GE(member.pid, 0);
    if (member.pid == 0) {
      ::close(ends[1]);
      run_member(folder_, band_, member.periods, ends[0]);
    }
    ::close(ends[0]);
    member.commands = ends[1];
    members_.push_back(member);
  }

  void kill(std::size_t which) {
    const SharingProcess member = members_[which];
    members_.erase(members_.begin() + static_cast<std::ptrdiff_t>(which));
    ::kill(member.pid, SIGKILL);
    ::waitpid(member.pid, nullptr, 0);
    ::close(member.commands);
  }

  void change(std::size_t which) {
    SharingProcess &member = members_[which];
    member.periods = any_periods();
    ASSERT_EQ(::write(member.commands, member.periods.data(), sizeof(member.periods)),
              static_cast<ssize_t>(sizeof(member.periods)));
  }

  Periods any_periods() {
    Periods periods{};
    for (int &period : periods) period = static_cast<int>(rng_.uniform(1, 20));
    return periods;
  }

  /// Says in what the kernel's priorities differ from the one order of all rates; empty: in nothing.
  [[nodiscard]] std::string difference() const {
    std::vector<int> rates;
    for (const SharingProcess &member : members_)
      rates.insert(rates.end(), member.periods.begin(), member.periods.end());
    std::sort(rates.begin(), rates.end());
    rates.erase(std::unique(rates.begin(), rates.end()), rates.end());
    std::string text;
    for (const SharingProcess &member : members_) {
      const std::map<std::string, int> priorities = priorities_of(member.pid);
      for (std::size_t i = 0; i < kJobs; ++i) {
        const auto rank = std::lower_bound(rates.begin(), rates.end(), member.periods[i]) - rates.begin();
        const int wanted = band_.top_job - static_cast<int>(rank);
        const auto found = priorities.find(fmt::format("task{}", i));
        const int has = found == priorities.end() ? 0 : found->second;
        if (has == wanted) continue;
        text += fmt::format("task {} of process {}, {} ms, has priority {} and not {}\n", i, member.pid,
                            member.periods[i], has, wanted);
      }
    }
    return text;
  }

  void expect_agreement() {
    const Time begin = monotonic_now();
    std::string left = difference();
    while (!left.empty() && monotonic_now() < begin + kLongEnough) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      left = difference();
    }
    EXPECT_EQ(left, "");
    took_.push_back(monotonic_now() - begin);
  }

  /// Kills, changes and starts up to three members, some of them at the same time or in the middle of what they do.
  void disturb() {
    for (auto times = rng_.uniform(1, 3); times > 0; --times) {
      const std::int64_t count = static_cast<std::int64_t>(members_.size());
      const auto which = static_cast<std::size_t>(rng_.uniform(0, std::max<std::int64_t>(count - 1, 0)));
      const std::int64_t what = count < 2 ? 0 : rng_.uniform(count < 6 ? 0 : 1, 2);
      if (what == 0) {
        come();
      } else if (what == 1) {
        kill(which);
      } else {
        change(which);
      }
      if (rng_.uniform(0, 1) == 0) std::this_thread::sleep_for(std::chrono::microseconds(rng_.uniform(0, 3000)));
    }
  }

  const PriorityBand band_ = probe_priority_band();
  Rng rng_{1};
  std::string folder_;
  std::vector<SharingProcess> members_;
  std::vector<Duration> took_;
};

TEST_F(OrderOfProcesses, AgreesAfterEachChange) {
  for (int i = 0; i < 3; ++i) come();
  expect_agreement();
  kill(1);
  expect_agreement();
  change(0);
  come();
  expect_agreement();
  EXPECT_EQ(live::read_order_pages(folder_).size(), members_.size());
}

TEST_F(OrderOfProcesses, AgreesWhenProcessesAreKilledAtRandom) {
  const char *const seconds = std::getenv("REDAG_ORDER_CHAOS");
  const Time begin = monotonic_now();
  const int least = 5;
  const auto goes_on = [&](int round) {
    if (seconds == nullptr) return round < least;
    return monotonic_now() - begin < std::atoi(seconds) * kSecond;
  };
  for (int round = 0; goes_on(round) && !HasFailure(); ++round) {
    disturb();
    expect_agreement();
  }
  while (members_.size() > 1) kill(0);
  if (!members_.empty()) expect_agreement();
  const auto files = std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator());
  EXPECT_LE(files, 2) << "dead processes leave nothing";
  if (seconds == nullptr) return;
  std::sort(took_.begin(), took_.end());
  fmt::print("{} agreements: median {} ms, longest {} ms\n", took_.size(), took_[took_.size() / 2] / kMillisecond,
             took_.back() / kMillisecond);
}

}  // namespace
}  // namespace redag::runtime
