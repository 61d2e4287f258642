// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests how threads of the middleware are recognised, raised and reported: with a library that starts threads as a
// middleware does, and with the middleware that the test runs on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "fake_middleware/fake_middleware.hpp"
#include "log_capture.hpp"
#include "mode_test.hpp"
#include "rcl/context.h"
#include "redag/live/middleware_names.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "spinning.hpp"
#include "watch/middleware_report.hpp"
#include "watch/middleware_threads.hpp"
#include "watch/start_routines.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using redag::runtime::Event;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Truly;

enum class Started { ByProgram, ByLibrary, ByLibraryAsStdThread };

/// A thread that waits until its object is destroyed.
class NamedThread {
 public:
  explicit NamedThread(const std::string &name, Started started = Started::ByLibrary, bool blocks_signals = true) {
    const auto main = [this, name, blocks_signals] {
      pthread_setname_np(pthread_self(), name.c_str());
      sigset_t all;
      sigfillset(&all);
      if (blocks_signals) pthread_sigmask(SIG_BLOCK, &all, nullptr);
      id_ = static_cast<int>(syscall(SYS_gettid));
      ready_.set();
      end_.wait();
    };
    switch (started) {
      case Started::ByProgram: {
        const auto thread = std::make_shared<std::thread>(main);
        join_ = [thread] { thread->join(); };
        break;
      }
      case Started::ByLibrary: join_ = start(fake_middleware::By::PthreadCreate, main); break;
      case Started::ByLibraryAsStdThread: join_ = start(fake_middleware::By::StdThread, main); break;
    }
    ready_.wait();
  }
  ~NamedThread() {
    end_.set();
    join_();
  }
  NamedThread(const NamedThread &) = delete;
  NamedThread &operator=(const NamedThread &) = delete;

  [[nodiscard]] int id() const { return id_; }
  [[nodiscard]] int policy() const { return sched_getscheduler(id_); }
  [[nodiscard]] int priority() const {
    sched_param parameters{};
    return sched_getparam(id_, &parameters) == 0 ? parameters.sched_priority : -1;
  }
  void set(int policy, int priority) const {
    const sched_param parameters{priority};
    EXPECT_EQ(sched_setscheduler(id_, policy, &parameters), 0);
  }

 private:
  Event ready_;
  Event end_;
  int id_ = 0;
  std::function<void()> join_;
};

std::vector<int> ids_of(const MiddlewareThreads &found) {
  std::vector<int> ids;
  for (const MiddlewareThread &thread : found.threads) ids.push_back(thread.id);
  return ids;
}

// ---- recognition ----

TEST(MiddlewareThreads, LibrariesAreKnownByTheirFiles) {
  for (const char *path : {"/opt/ros/jazzy/lib/libddsc.so.0.10.5", "libddsc.so", "/usr/lib/libfastrtps.so.2.14",
                           "/usr/lib/libfastdds.so.3.2", "/opt/libzenohc.so"}) {
    EXPECT_TRUE(is_middleware_library(path)) << path;
  }
  for (const char *path : {"/opt/libddsc.so.d/libcamera.so", "/usr/lib/libddscxx.so", "/usr/lib/libstdc++.so.6",
                           "a.out", "libmy_libddsc.so", ""}) {
    EXPECT_FALSE(is_middleware_library(path)) << path;
  }
}

/// Tests that need the start routines of threads. Sanitizers hide them: each thread starts in a function of theirs.
class StartRoutinesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!routines) GTEST_SKIP() << to_string(routines.error());
  }

  const redag::Result<StartRoutines> routines = StartRoutines::locate();
};

TEST_F(StartRoutinesTest, NameTheLibraryThatStartedAThread) {
  const NamedThread routine("a", Started::ByLibrary);
  const NamedThread object("b", Started::ByLibraryAsStdThread);
  const NamedThread program("c", Started::ByProgram);
  EXPECT_THAT(routines->library_of(routine.id()), EndsWith("/libzenohc.so"));
  EXPECT_THAT(routines->library_of(object.id()), EndsWith("/libzenohc.so"));
  EXPECT_THAT(routines->library_of(program.id()), HasSubstr("middleware_test"));
}

TEST_F(StartRoutinesTest, AreUnknownOfTheMainThreadAndOfNone) {
  EXPECT_EQ(routines->library_of(getpid()), "");
  int gone = 0;
  {
    const NamedThread thread("gone");
    gone = thread.id();
  }
  EXPECT_EQ(routines->library_of(gone), "");
}

TEST_F(StartRoutinesTest, TellThreadsOfAnyNameFromUsersThreads) {
  const NamedThread unnamed("robot", Started::ByLibraryAsStdThread, false);
  const NamedThread foreign("rx-0", Started::ByLibrary, false);
  const NamedThread user("recv", Started::ByProgram, true);
  const MiddlewareThreads found = find_middleware_threads();
  EXPECT_EQ(found.by_names_because, "");
  EXPECT_THAT(ids_of(found), AllOf(Contains(unnamed.id()), Contains(foreign.id()), Not(Contains(user.id()))));
}

TEST(MiddlewareThreads, AUsersThreadOfTheSameNameIsNotOne) {
  const NamedThread user("recv", Started::ByProgram, false);
  const NamedThread middleware("recv", Started::ByLibrary, true);
  EXPECT_THAT(ids_of(find_middleware_threads()), AllOf(Contains(middleware.id()), Not(Contains(user.id()))));
}

// ---- raising ----

class RaisedThreads : public ::testing::Test {
 protected:
  void SetUp() override {
    if (redag::runtime::available_fifo_priority(90) < 90) GTEST_SKIP() << "SCHED_FIFO is not to be had here";
  }
};

TEST_F(RaisedThreads, GetBackWhatTheyHad) {
  const NamedThread ordinary("recv");
  const NamedThread batch("tev");
  batch.set(SCHED_BATCH, 0);
  const NamedThread low("dq.user");
  low.set(SCHED_RR, 10);
  const NamedThread high("recvUC");
  high.set(SCHED_FIFO, 95);
  {
    const RaisedMiddleware raised(90);
    EXPECT_THAT(ids_of(raised.found()),
                AllOf(Contains(ordinary.id()), Contains(batch.id()), Contains(low.id()), Contains(high.id())));
    for (const NamedThread *thread : {&ordinary, &batch, &low}) {
      EXPECT_EQ(thread->policy(), SCHED_FIFO);
      EXPECT_EQ(thread->priority(), 90);
    }
    EXPECT_EQ(high.priority(), 95);
  }
  EXPECT_EQ(ordinary.policy(), SCHED_OTHER);
  EXPECT_EQ(batch.policy(), SCHED_BATCH);
  EXPECT_EQ(low.policy(), SCHED_RR);
  EXPECT_EQ(low.priority(), 10);
  EXPECT_EQ(high.priority(), 95);
}

TEST_F(RaisedThreads, ThatAppearLateAreFoundByTheNextLook) {
  const NamedThread early("recv");
  RaisedMiddleware raised(90);
  {
    const NamedThread late("tev");
    EXPECT_EQ(late.priority(), 0);
    early.set(SCHED_FIFO, 33);
    raised.look();
    EXPECT_EQ(late.priority(), 90);
    EXPECT_EQ(early.priority(), 33) << "somebody else gave it this priority";
  }
  raised.look();
}

TEST_F(RaisedThreads, InTheBackgroundKeepTheirPriority) {
  std::vector<std::unique_ptr<NamedThread>> background;
  for (const char *name : {"gc", "debmon", "threadmon", "dds.log", "dds.slog.0", "dds.shmd.1", "dds.shm.wdog",
                           "dds.tls.replies", "dds.fwatch", "dds.fwatch.cb"}) {
    background.push_back(std::make_unique<NamedThread>(name));
  }
  const NamedThread delivers("tev");
  const RaisedMiddleware raised(90);
  EXPECT_EQ(delivers.priority(), 90);
  for (const auto &thread : background) EXPECT_EQ(thread->policy(), SCHED_OTHER);
}

TEST_F(RaisedThreads, AreOnlyLookedAtWithoutAPriority) {
  const NamedThread thread("recv");
  const RaisedMiddleware raised(0);
  EXPECT_THAT(ids_of(raised.found()), Contains(thread.id()));
  EXPECT_EQ(thread.policy(), SCHED_OTHER);
}

TEST_F(RaisedThreads, StayRaisedUntilTheLastExecutorIsDone) {
  const NamedThread thread("recv");
  auto first = std::make_unique<RaisedMiddleware>(40);
  auto second = std::make_unique<RaisedMiddleware>(90);
  second->look();
  EXPECT_EQ(thread.priority(), 90);
  first.reset();
  EXPECT_EQ(thread.priority(), 90);
  second.reset();
  EXPECT_EQ(thread.policy(), SCHED_OTHER);
}

TEST_F(RaisedThreads, KeepAPriorityThatSomebodyElseGaveThem) {
  const NamedThread thread("recv");
  {
    const RaisedMiddleware raised(90);
    thread.set(SCHED_FIFO, 33);
  }
  EXPECT_EQ(thread.policy(), SCHED_FIFO);
  EXPECT_EQ(thread.priority(), 33);
}

// ---- the report ----

MiddlewareThread thread_of(const std::string &name, int priority, bool delivers = true) {
  return {.id = 1, .name = name, .delivers = delivers, .priority = priority};
}

constexpr int kTopJob = 80;
constexpr int kTimer = 90;

MiddlewareReport report(std::vector<MiddlewareThread> threads, int wanted = kTimer, const std::string &because = "") {
  return describe({.threads = std::move(threads), .by_names_because = because},
                  {.rmw = "rmw_x", .wanted = wanted, .top_job = kTopJob, .timer = kTimer});
}

TEST(MiddlewareReport, NamesThreadsByPriority) {
  const MiddlewareReport all_well =
      report({thread_of("gc", 0, false), thread_of("recv", 90), thread_of("recv", 90), thread_of("tev", 95)});
  EXPECT_EQ(all_well.summary,
            "4 threads of rmw_x: tev have priority 95; recv (2) have priority 90; gc in the background");
  EXPECT_THAT(all_well.warnings, IsEmpty());
}

TEST(MiddlewareReport, SaysWhyThreadsAreKnownByTheirNames) {
  EXPECT_THAT(report({thread_of("recv", 90)}, kTimer, "no memory").summary,
              EndsWith("(recognised by name alone: no memory)"));
}

TEST(MiddlewareReport, SaysHowToMendThatNoneIsFound) {
  EXPECT_THAT(report({}).warnings,
              ElementsAre(AllOf(HasSubstr("no thread of rmw_x that delivers"), HasSubstr("SCHED_FIFO priority 90"))));
  EXPECT_THAT(report({thread_of("gc", 0, false)}).warnings, ElementsAre(HasSubstr("no thread of rmw_x")));
}

TEST(MiddlewareReport, SaysHowToMendARefusal) {
  EXPECT_THAT(report({thread_of("recv", 0), thread_of("tev", 90)}).warnings,
              ElementsAre(AllOf(HasSubstr("refused priority 90 to these threads: recv;"), HasSubstr("rtprio"))));
}

TEST(MiddlewareReport, SaysHowToMendThreadsThatAreLeftBelowTheWorkers) {
  EXPECT_THAT(report({thread_of("recv", kTopJob), thread_of("tev", kTopJob + 1)}, 0).warnings,
              ElementsAre(AllOf(HasSubstr("not above them: recv;"), HasSubstr("'raise_middleware'"))));
}

// ---- the executor ----

class MiddlewareTest : public ModeTest {
 protected:
  [[nodiscard]] static int above_jobs() { return redag::runtime::probe_priority_band().timer; }
};

TEST_P(MiddlewareTest, ThreadsAreRaisedWhileItSpins) {
  const NamedThread user("recv_camera", Started::ByProgram);
  const NamedThread middleware("recv");
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  const LogCapture log;
  {
    const Spinner spinner(executor);
    EXPECT_TRUE(eventually([&] { return middleware.priority() == above_jobs(); }));
    EXPECT_EQ(user.policy(), SCHED_OTHER);
    // Threads that appear late are raised, too, and reported.
    const NamedThread late("tev");
    EXPECT_TRUE(eventually([&] { return late.priority() == above_jobs(); }));
    EXPECT_TRUE(eventually([&] { return LogCapture::has("threads of rmw_") && LogCapture::has("tev"); }));
    // So are those that appear with an entity, however long after the start.
    const NamedThread with_entity("recvMC");
    const auto subscription = subscribe("/topic", [] {});
    EXPECT_TRUE(eventually([&] { return with_entity.priority() == above_jobs(); }));
  }
  EXPECT_EQ(middleware.policy(), SCHED_OTHER);
  EXPECT_EQ(user.policy(), SCHED_OTHER);
}

// Real threads of the middleware that the test runs on. Each middleware that was tested has some.
TEST_P(MiddlewareTest, TheMiddlewaresOwnThreadsAreFound) {
  const rclcpp::Context::SharedPtr context = node->get_node_base_interface()->get_context();
  const rmw_context_t *const rmw = rcl_context_get_rmw_context(context->get_rcl_context().get());
  const std::string name = rmw->implementation_identifier;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  const auto deliver = [] {
    std::vector<MiddlewareThread> threads = find_middleware_threads().threads;
    threads.erase(std::remove_if(threads.begin(), threads.end(), [](const auto &thread) { return !thread.delivers; }),
                  threads.end());
    return threads;
  };
  ASSERT_THAT(deliver(), Not(IsEmpty())) << name;
  const LogCapture log;
  {
    const Spinner spinner(executor);
    EXPECT_TRUE(eventually([&] { return LogCapture::has("threads of " + name + ": "); }));
    // A thread that started after the first look is raised by the next one.
    EXPECT_TRUE(eventually([&] {
      const std::vector<MiddlewareThread> threads = deliver();
      return std::all_of(threads.begin(), threads.end(), [](const auto &t) { return t.priority == above_jobs(); });
    }));
    const MiddlewareThreads all = find_middleware_threads();
    std::vector<std::string> names;
    std::vector<std::string> background;
    for (const MiddlewareThread &thread : all.threads) (thread.delivers ? names : background).push_back(thread.name);
    if (name == "rmw_cyclonedds_cpp" && all.by_names_because.empty()) {
      EXPECT_THAT(names, AllOf(Contains("recv"), Contains("tev"), Contains("dq.user")));
      EXPECT_THAT(background, Contains("gc"));
    }
    // Fast DDS names its threads since 2.11. Then the list of names has to be complete.
    if (name.rfind("rmw_fastrtps", 0) == 0 &&
        std::any_of(names.begin(), names.end(), redag::live::is_middleware_thread_name)) {
      EXPECT_THAT(names, Each(Truly(redag::live::is_middleware_thread_name)));
    }
  }
  EXPECT_THAT(deliver(), Each(::testing::Field(&MiddlewareThread::priority, 0)));
  EXPECT_THAT(executor.warnings(), Not(Contains(HasSubstr(name))));
}

TEST_P(MiddlewareTest, ThreadsLeftAloneAreReported) {
  options.raise_middleware = false;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  const Spinner spinner(executor);
  EXPECT_TRUE(eventually([&] {
    const std::vector<std::string> warnings = executor.warnings();
    return std::any_of(warnings.begin(), warnings.end(), [](const std::string &warning) {
      return warning.find("set 'raise_middleware'") != std::string::npos;
    });
  }));
}

// In the other modes workers have no priority.
INSTANTIATE_TEST_SUITE_P(Modes, MiddlewareTest, ::testing::Values(redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
