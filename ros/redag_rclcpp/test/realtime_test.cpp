// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests what the executor requests from Linux: priorities of its own threads, locked memory, and threads. Includes
// threads that cannot be created, messages that wait, and jobs that do not end.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "log_capture.hpp"
#include "mode_test.hpp"
#include "process_tasks.hpp"
#include "rclcpp/waitable.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "redag_rclcpp/any_waitable.hpp"
#include "spinning.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using redag::runtime::Event;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

// ---- the executor's threads ----

/// Names and SCHED_FIFO priorities of the threads of this process; 0: no such priority.
std::vector<std::pair<std::string, int>> thread_priorities() {
  std::vector<std::pair<std::string, int>> result;
  std::error_code ignored;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    std::string name;
    std::ifstream file(entry.path() / "comm");
    if (!std::getline(file, name)) continue;
    sched_param parameters{};
    const int id = std::stoi(entry.path().filename());
    const bool fifo = sched_getscheduler(id) == SCHED_FIFO && sched_getparam(id, &parameters) == 0;
    result.emplace_back(name, fifo ? parameters.sched_priority : 0);
  }
  return result;
}

class RealtimeTest : public ModeTest {
 protected:
  [[nodiscard]] int above_jobs() const {
    return GetParam() == redag::PreemptionMode::Os ? redag::runtime::probe_priority_band().timer : 0;
  }
};

/// A waitable that records the priority of the thread that attaches it.
class NotingWaitable final : public AnyWaitable {
 public:
  void fill(rcl_wait_set_t &) override {}
  bool is_ready_in(const rcl_wait_set_t &) override { return false; }
  void run(const std::shared_ptr<void> &) override {}
  void set_on_ready_callback(std::function<void(std::size_t, int)>) override {
    priority = redag::runtime::fifo_priority(pthread_self());
  }
  void clear_on_ready_callback() override {}

  std::atomic<int> priority{-1};
};

// Collecting entities takes time that grows with their number, and must not run above jobs.
TEST_P(RealtimeTest, CollectingEntitiesIsNoneOfTheUrgentWork) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  const Spinner spinner(executor);
  auto waitable = std::make_shared<NotingWaitable>();
  node->get_node_waitables_interface()->add_waitable(waitable, nullptr);
  EXPECT_TRUE(eventually([&] { return waitable->priority >= 0; }));
  EXPECT_EQ(waitable->priority, 0);
  // The threads that report arrivals stay above all jobs.
  for (const char *name : {"redag-wait", "redag-timer"}) {
    const std::pair<std::string, int> expected(name, above_jobs());
    EXPECT_TRUE(eventually([&] {
      const auto threads = thread_priorities();
      return std::find(threads.begin(), threads.end(), expected) != threads.end();
    })) << name;
  }
}

// The wait set holds a subscription whose hook the user has set. If the program drops it meanwhile, what its callback
// captured is destroyed on the thread that spins.
TEST_P(RealtimeTest, WhatIsDroppedWhileItIsWaitedForIsNotDestroyedAboveJobs) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> priority{-1};
  std::shared_ptr<void> captured(&priority, [](void *noted) {
    *static_cast<std::atomic<int> *>(noted) = redag::runtime::fifo_priority(pthread_self());
  });
  std::atomic<int> calls{0};
  auto subscription = subscribe("/dropped", [&calls, captured] { ++calls; });
  captured.reset();
  subscription->set_on_new_message_callback([](std::size_t) {});
  const auto topic = publisher("/dropped");
  executor.add_node(node);
  Spinner spinner(executor);
  ASSERT_TRUE(eventually([&] { return calls > 0; },
                         [&] {
                           topic->publish(Empty());
                           std::this_thread::sleep_for(5ms);
                         }));
  std::this_thread::sleep_for(100ms);  // until the wait set watches it again
  subscription.reset();
  EXPECT_EQ(priority, -1) << "nothing else holds it";
  spinner.stop();
  EXPECT_EQ(priority, 0);
}

// Made while the executor is there, as by components. Its due time lies beyond the largest number there is.
TEST_P(RealtimeTest, ATimerThatNeverExpiresTakesNoProcessor) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  const Spinner spinner(executor);
  const auto never = node->create_wall_timer(std::chrono::nanoseconds::max(), [] {});
  std::this_thread::sleep_for(100ms);
  const std::clock_t before = std::clock();
  std::this_thread::sleep_for(500ms);
  EXPECT_LT(std::clock() - before, CLOCKS_PER_SEC / 4);
}

// The thread that called spin() is an ordinary one. It gets no processor while jobs use all of them.
// As with `chrt -f 10`. Without `os`, workers inherit that priority, and the middleware's threads are raised above it.
TEST_P(RealtimeTest, NoWarningOfWorkersThatAreBelowTheMiddleware) {
  if (redag::runtime::available_fifo_priority(11) < 11) GTEST_SKIP() << "this process may not use SCHED_FIFO 11";
  const LogCapture log;
  std::thread([&] {
    ASSERT_TRUE(redag::runtime::set_fifo_priority(pthread_self(), 10));
    ReDAGExecutor executor(options);
    executor.add_node(node);
    const rclcpp::TimerBase::SharedPtr timer = node->create_wall_timer(1ms, [&] {
      if (log.has("have priority")) executor.cancel();
    });
    executor.spin();
  }).join();
  EXPECT_EQ(log.warnings_with("can delay messages"), 0);
}

TEST_P(RealtimeTest, CancelTakesEffectWhileJobsUseTheProcessor) {
  if (GetParam() != redag::PreemptionMode::Os) GTEST_SKIP() << "without real-time jobs all threads get their share";
  const int processor = redag::runtime::usable_cpus().back();
  options.cpus = {processor};
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> calls{0};
  constexpr int kBefore = 20;
  constexpr int kMost = 5000;  // several times the jobs between two pauses of real-time throttling
  const auto topic = publisher("/again");
  auto subscription = subscribe("/again", [&] {
    if (calls < kMost) topic->publish(Empty());
    use_processor(1ms);
    if (++calls == kBefore) executor.cancel();
  });
  executor.add_node(node);
  topic->publish(Empty());
  std::thread spinning([&] {
    ASSERT_TRUE(redag::runtime::set_up_this_thread({"spinning", 0, {processor}}));
    executor.spin();
  });
  spinning.join();
  EXPECT_GE(calls, kBefore);
  EXPECT_LT(calls, 10 * kBefore) << "the cancel() waited for jobs to leave the processor";
}

TEST_P(RealtimeTest, ASpinAfterOneThatHadNoThreadsWorks) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> ticks{0};
  auto timer = node->create_wall_timer(
      5ms, [&] { ++ticks; }, new_group());
  executor.add_node(node);
  // Uses up the memory for thread stacks: no further thread can be created.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  std::string first;
  {
    std::ifstream statm("/proc/self/statm");
    rlim_t pages = 0;
    statm >> pages;
    std::vector<std::thread> others;
    Event end;
    const rlimit tight{pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (rlim_t{1} << 20), before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_AS, &tight), 0);
    try {
      // The threads keep running, because stacks of ended threads are reused.
      for (;;) others.emplace_back([&end] { end.wait(); });
    } catch (const std::system_error &) {
    }
    try {
      executor.spin();
    } catch (const std::runtime_error &error) {
      first = error.what();
    }
    ASSERT_EQ(setrlimit(RLIMIT_AS, &before), 0);
    end.set();
    for (std::thread &thread : others) thread.join();
  }
  EXPECT_THAT(first, HasSubstr("cannot be created"));
  const Spinner spinner(executor);
  EXPECT_TRUE(eventually([&] { return ticks >= 3; }));
}

// ---- memory ----

std::size_t locked_kilobytes() {
  std::ifstream file("/proc/self/status");
  std::string key;
  std::size_t amount = 0;
  while (file >> key && key != "VmLck:") {
  }
  file >> amount;
  return amount;
}

/// Number of absent pages among the `bytes` of stack below the caller's frame.
std::size_t absent_pages_below(std::size_t bytes) {
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto here = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)) / page * page;
  std::vector<unsigned char> resident(bytes / page);
  EXPECT_EQ(mincore(reinterpret_cast<void *>(here - bytes), bytes, resident.data()), 0);
  return static_cast<std::size_t>(std::count_if(resident.begin(), resident.end(), [](auto r) { return (r & 1) == 0; }));
}

TEST_P(RealtimeTest, LockedMemoryIsThereBeforeCallbacksNeedIt) {
  options.lock_memory = true;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<bool> ran{false};
  std::size_t absent = 0;
  auto timer = node->create_wall_timer(
      1ms,
      [&] {
        if (ran) return;
        absent = absent_pages_below(redag::runtime::kTouchedStack / 2);
        ran = true;
      },
      new_group());
  executor.add_node(node);
  {
    const Spinner spinner(executor);
    EXPECT_TRUE(eventually([&] { return ran.load(); }));
    if (locked_kilobytes() == 0) {
      EXPECT_THAT(executor.warnings(), Contains(AllOf(HasSubstr("locked"), HasSubstr("memlock"))));
    }
  }
  EXPECT_EQ(absent, 0U);
  munlockall();
}

// ---- messages that wait ----

/// Processor time of the thread that waits for what has no hooks.
std::chrono::nanoseconds time_of_wait_set() {
  for (const auto &[id, task] : process_tasks()) {
    if (task.name == "redag-wait") return task.processor_time;
  }
  return std::chrono::nanoseconds(-1);
}

// rmw_fastrtps ends a wait for a QoS event at once while the event's subscription has messages. The executor waits so
// for an event that the user has hooked.
TEST_P(RealtimeTest, AMessageThatWaitsForItsGroupTakesNoProcessor) {
  const auto group = new_group();
  rclcpp::SubscriptionOptions with_event;
  with_event.callback_group = group;
  with_event.event_callbacks.deadline_callback = [](rclcpp::QOSDeadlineRequestedInfo &) {};
  std::atomic<int> received{0};
  const rclcpp::QoS qos = rclcpp::QoS(10).deadline(1h);
  const auto subscription = node->create_subscription<Empty>(
      "/waits", qos, [&](Empty::ConstSharedPtr) { ++received; }, with_event);
  subscription->set_on_new_qos_event_callback([](std::size_t) {}, RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED);
  const auto elsewhere = std::make_shared<rclcpp::Node>("elsewhere");  // sends through the middleware
  const auto out = elsewhere->create_publisher<Empty>("/waits", qos);
  Event holds_group;
  Event end;
  const auto timer = node->create_wall_timer(
      1ms,
      [&] {
        holds_group.set();
        end.wait();
      },
      group);
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  ASSERT_TRUE(eventually([&] { return out->get_subscription_count() == 1; }));
  const Spinner spinner(executor);
  holds_group.wait();
  EXPECT_TRUE(eventually([] { return time_of_wait_set() >= 0ns; })) << "the thread names itself when it begins";
  const std::chrono::nanoseconds before = time_of_wait_set();
  out->publish(Empty());
  std::this_thread::sleep_for(300ms);
  EXPECT_LT(time_of_wait_set() - before, 150ms);
  EXPECT_EQ(received, 0);
  end.set();
  EXPECT_TRUE(eventually([&] { return received == 1; }));
}

// ---- jobs that do not end ----

TEST_P(RealtimeTest, TheWatchdogNamesACallbackThatDoesNotEnd) {
  options.watchdog = 30ms;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  Event end;
  auto subscription = subscribe("/stuck", [&] { end.wait(); });
  executor.add_node(node);
  const LogCapture log;
  const Spinner spinner(executor);
  publisher("/stuck")->publish(Empty());
  EXPECT_TRUE(eventually([&] { return log.has("/stuck: in progress for"); }));
  end.set();
}

// Only with os do bounds count on as many processors as workers.
TEST_P(RealtimeTest, MoreWorkersThanProcessorsAreAnErrorWithOs) {
  options.workers = static_cast<std::uint32_t>(redag::runtime::usable_cpus().size()) + 1;
  const ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  const auto missing = HasSubstr("processor(s)");
  EXPECT_THAT(executor.warnings(), Contains(missing));
  if (GetParam() == redag::PreemptionMode::Os) {
    EXPECT_THAT(executor.errors(), ::testing::ElementsAre(missing));
  } else {
    EXPECT_THAT(executor.errors(), ::testing::IsEmpty());
  }
}

TEST_P(RealtimeTest, ANegativeTimeIsRefused) {
  options.watchdog = -1ns;
  EXPECT_THROW(ReDAGExecutor(rclcpp::ExecutorOptions(), options), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Modes, RealtimeTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
