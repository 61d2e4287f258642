// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an Executor and a DagBuilder refuse, in the caller's words instead of those of the file format.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "redag/loader/validate.hpp"
#include "redag/runtime/executor.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

ExecutorOptions without_preemption() {
  ExecutorOptions options;
  options.workers = 1;
  options.preemption = PreemptionMode::None;
  return options;
}

template <class Exception = std::invalid_argument>
std::string thrown_by(const std::function<void()> &call) {
  try {
    call();
  } catch (const Exception &error) {
    return error.what();
  }
  return "nothing was thrown";
}

const TaskBody kBody = [] {};

/// Returns the text of the exception that add() throws for a DAG with a task `t` made by `make`.
std::string refused(const std::function<void(DagBuilder &)> &make, const DagOptions &dag_options = {}) {
  Executor executor(without_preemption());
  DagBuilder dag("d", dag_options);
  make(dag);
  return thrown_by([&] { executor.add(std::move(dag)); });
}

TEST(DagBuilder, RefusesTasksOfOtherBuilders) {
  DagBuilder one("one");
  DagBuilder other("other");
  const TaskHandle first = one.timer("first", 1ms, kBody);
  const TaskHandle foreign = other.timer("foreign", 1ms, kBody);  // the same index as `first`
  const std::string says = "a predecessor belongs to another DagBuilder";
  EXPECT_THAT(thrown_by([&] { one.data("next", {foreign}, kBody); }),
              AllOf(HasSubstr("DagBuilder(\"one\").data(\"next\")"), HasSubstr(says)));
  EXPECT_THAT(thrown_by([&] { one.timer("next", 1ms, kBody, {.after = {foreign}}); }),
              AllOf(HasSubstr("DagBuilder(\"one\").timer(\"next\")"), HasSubstr(says)));
  // A copy has the tasks that existed when it was made, not later ones of the original.
  DagBuilder copy = one;
  copy.data("same", {first}, kBody);
  const TaskHandle later = one.timer("later", 1ms, kBody);
  EXPECT_THAT(thrown_by([&] { copy.data("bad", {later}, kBody); }), HasSubstr(says));
  // Refused calls changed nothing.
  Executor executor(without_preemption());
  EXPECT_EQ(executor.stats(executor.add(std::move(one))).size(), 2U);
}

TEST(DagBuilder, RefusesTasksWithoutABody) {
  DagBuilder dag("d");
  EXPECT_THAT(thrown_by([&] { dag.timer("t", 1ms, nullptr); }),
              AllOf(HasSubstr("DagBuilder(\"d\").timer(\"t\")"), HasSubstr("no body")));
  const TaskHandle first = dag.timer("first", 1ms, kBody);
  EXPECT_THAT(thrown_by([&] { dag.data("t", {first}, kBody, {.after = {first}}); }),
              HasSubstr("TaskOptions::after applies to timer()"));
}

TEST(Executor, NamesTheCallAndTheOptionOfEveryMistake) {
  struct Mistake {
    std::function<void(DagBuilder &)> make;
    const char *place;
    const char *says;
    const char *remedy;
  };
  const auto with = [](TaskOptions options) {
    return [options](DagBuilder &dag) { dag.timer("t", 5ms, kBody, options); };
  };
  const std::string task = "DagBuilder(\"d\").timer(\"t\")";
  const std::vector<Mistake> mistakes = {
      {[](DagBuilder &) {}, "DagBuilder(\"d\"): ", "has no tasks", "timer() and data()"},
      {[](DagBuilder &dag) { dag.timer("t", 0ms, kBody); }, task.c_str(), "greater than 0",
       "second argument of timer()"},
      {[](DagBuilder &dag) { dag.timer("t", -1ms, kBody); }, task.c_str(), "-1ms", "second argument of timer()"},
      {[](DagBuilder &dag) { dag.timer("t", nanoseconds::max(), kBody); }, task.c_str(), "too large", "timer()"},
      {[](DagBuilder &dag) { dag.timer("t", 999ns, kBody); }, task.c_str(), "every 999ns", "at least 1us"},
      {[](DagBuilder &dag) { dag.timer("", 1ms, kBody); }, "timer(\"\")", "no name", "first argument"},
      {[](DagBuilder &dag) { dag.timer("\x1b[2J", 1ms, kBody); }, "timer(\"\\u{1B}[2J\")", "U+001B", "first argument"},
      {[](DagBuilder &dag) { dag.data("t", {}, kBody); }, ".data(\"t\")", "no predecessor",
       "second argument of data()"},
      {[](DagBuilder &dag) {
         const TaskHandle first = dag.timer("first", 1ms, kBody);
         dag.data("t", {first, first}, kBody);
       },
       ".data(\"t\")", "'first' twice", "second argument of data()"},
      {with({.wcet = -1ns}), task.c_str(), "wcet", "TaskOptions::wcet"},
      {with({.deadline = -1ns}), task.c_str(), "deadline", "TaskOptions::deadline"},
      {with({.offset = -1ns}), task.c_str(), "offset", "TaskOptions::offset"},
      {with({.budget = nanoseconds::max()}), task.c_str(), "budget", "TaskOptions::budget"},
      {with({.overrun = Overrun::Queue, .queue_depth = 0}), task.c_str(), "queue depth", "TaskOptions::queue_depth"},
      {with({.queue_depth = 3}), task.c_str(), "TaskOptions::queue_depth", "Overrun::Queue"},
      {with({.group = "a\nb"}), task.c_str(), "group", "TaskOptions::group"},
  };
  for (const Mistake &mistake : mistakes) {
    EXPECT_THAT(refused(mistake.make), AllOf(HasSubstr("Executor::add(): "), HasSubstr(mistake.place),
                                             HasSubstr(mistake.says), HasSubstr(mistake.remedy), Not(HasSubstr(":'"))));
  }
  EXPECT_THAT(refused([](DagBuilder &dag) { dag.timer("t", 1ms, kBody); }, {.max_active = kMaxBound + 1}),
              AllOf(HasSubstr("DagBuilder(\"d\"): max_active"), HasSubstr("DagOptions::max_active")));
}

TEST(Executor, RefusesABadDagWithEveryMistakeAndChangesNothing) {
  Executor executor(without_preemption());
  DagBuilder dag("dag");
  dag.timer("a", 0ms, kBody);
  dag.timer("a", -1ms, kBody);
  const std::string said = thrown_by([&] { executor.add(std::move(dag)); });
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 2) << said;
  EXPECT_THAT(said, AllOf(HasSubstr("greater than 0"), HasSubstr("-1ms"), HasSubstr("used by another task")));
  DagBuilder good("dag");
  good.timer("a", 1ms, kBody);
  EXPECT_EQ(executor.add(std::move(good)), DagId(0));
}

TEST(Executor, NamesOfDagsAreUniqueAmongThoseThere) {
  Executor executor(without_preemption());
  const auto dag = [] {
    DagBuilder builder("same");
    builder.timer("t", 1ms, kBody);
    return builder;
  };
  const DagId first = executor.add(dag());
  EXPECT_THAT(thrown_by([&] { executor.add(dag()); }),
              AllOf(HasSubstr("DagBuilder(\"same\")"), HasSubstr("another DAG in the executor has this name"),
                    HasSubstr("remove()")));
  executor.remove(first);
  EXPECT_EQ(executor.add(dag()), DagId(1));
}

TEST(Executor, RefusesOptionsOutOfRange) {
  const auto refused_with = [](const std::function<void(ExecutorOptions &)> &change) {
    ExecutorOptions options = without_preemption();
    change(options);
    return thrown_by([&] { Executor{options}; });
  };
  EXPECT_THAT(refused_with([](auto &o) { o.workers = kMaxWorkers + 1; }),
              HasSubstr("ExecutorOptions::workers must be from 0 to 4096, not 4097"));
  EXPECT_THAT(refused_with([](auto &o) { o.threads = 1'000'000; }), HasSubstr("ExecutorOptions::threads"));
  EXPECT_THAT(refused_with([](auto &o) { o.workers = 4, o.threads = 2; }),
              HasSubstr("must be 0 or at least 4, the number of workers"));
  EXPECT_THAT(refused_with([](auto &o) { o.spin = -1ns; }), HasSubstr("ExecutorOptions::spin"));
  EXPECT_THAT(refused_with([](auto &o) { o.stop_timeout = nanoseconds::max(); }), HasSubstr("::stop_timeout"));
  EXPECT_THAT(refused_with([](auto &o) { o.name = "\x1b[2J"; }), HasSubstr("::name '\\u{1B}[2J' contains U+001B"));
  EXPECT_THAT(refused_with([](auto &o) { o.trace_capacity = std::numeric_limits<std::size_t>::max(); }),
              HasSubstr("::trace_capacity"));
  EXPECT_THAT(refused_with([](auto &o) { o.watchdog = WatchdogOptions{}; }), HasSubstr("no job would be overdue"));
  EXPECT_THAT(refused_with([](auto &o) {
                o.watchdog = WatchdogOptions{{0, std::numeric_limits<double>::quiet_NaN()}, kMillisecond};
              }),
              HasSubstr("limits.deadlines"));
  Executor executor(without_preemption());
  EXPECT_THAT(thrown_by([&] { executor.run_for(-1ms); }),
              HasSubstr("Executor::run_for(): the duration -1ms is negative"));
}

TEST(Executor, NamesTheCallThatCameTooEarlyOrTooLate) {
  Executor executor(without_preemption());
  EXPECT_THAT(thrown_by<std::logic_error>([&] { executor.wait(); }),
              HasSubstr("Executor::wait(): the executor is not started"));
  EXPECT_THAT(thrown_by<std::out_of_range>([&] { executor.remove(DagId(7)); }),
              HasSubstr("Executor::remove(): there is no DAG 7"));
  EXPECT_THAT(thrown_by<std::out_of_range>([&] { (void)executor.stats(DagId(7)); }), HasSubstr("Executor::stats()"));
}

}  // namespace
}  // namespace redag::runtime
