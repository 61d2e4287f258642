// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/validate.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag {
namespace {

Workload valid() {
  return testing::make_workload({testing::make_dag("d", {{"a", 10}, {"b", 0, 1, {0}}})}, 1, PreemptionMode::Auto);
}

TEST(Validate, AcceptsAValidWorkload) { EXPECT_EQ(to_string(validate(valid())), ""); }

TEST(Validate, MakesWhatExecutorsTake) {
  Workload workload = valid();
  const Result<ValidWorkload> made = validated(workload);
  ASSERT_TRUE(made) << to_string(made.error());
  EXPECT_EQ(**made, workload);
  workload.dags[0].tasks[0].period = 0;
  EXPECT_FALSE(validated(workload));
}

TEST(Validate, RefusesWhatOnlyCppCanBuild) {
  Workload workload = valid();
  workload.platform.workers = 0;
  workload.dags[0].tasks[0].predecessors = {7};
  workload.dags[0].tasks[0].wcet = kMaxDuration + 1;
  workload.dags[0].deadline = -1;
  const std::string found = to_string(validate(workload));
  EXPECT_NE(found.find("workers must be from 1 to 4096, not 0"), std::string::npos) << found;
  EXPECT_NE(found.find("predecessor 7 of task 'a' does not exist"), std::string::npos) << found;
  EXPECT_NE(found.find("wcet of task 'a' is too large"), std::string::npos) << found;
  EXPECT_NE(found.find("deadline of DAG 'd' must not be negative, not -1ns"), std::string::npos) << found;
}

TEST(Validate, RefusesNamesThatCannotBeShown) {
  const auto mistake = [](auto change) {
    Workload workload = valid();
    change(workload);
    return to_string(validate(workload));
  };
  const auto has = [](const std::string &text, const char *words) { return text.find(words) != std::string::npos; };
  const std::string escape = "\x1b[2J";
  EXPECT_TRUE(has(mistake([&](Workload &w) { w.name = escape; }), "of a workload contains U+001B"));
  EXPECT_TRUE(has(mistake([&](Workload &w) { w.dags[0].name = "a\xC2\x9B"; }), "of a DAG contains U+009B"));
  EXPECT_TRUE(has(mistake([&](Workload &w) { w.dags[0].tasks[0].name = " a"; }), "begins or ends with a space"));
  EXPECT_TRUE(has(mistake([&](Workload &w) { w.dags[0].tasks[0].group = escape; }), "group '\\u{1B}[2J'"));
  const std::string huge = mistake([&](Workload &w) { w.dags[0].name = std::string(1'000'000, 'x'); });
  EXPECT_TRUE(has(huge, "has 1000000 bytes; at most 1000"));
  EXPECT_LT(huge.size(), 1000U);
  EXPECT_EQ(name_mistake("µ-arm 2.λ"), "");
}

TEST(Validate, RefusesBoundsBeyondTheLimit) {
  Workload workload = valid();
  workload.dags[0].max_active = kMaxBound + 1;
  EXPECT_NE(to_string(validate(workload)).find("max_active of DAG 'd' must be from 1 to 1000000"), std::string::npos);
}

TEST(Validate, RefusesCallbacksThatTheFormatCannotHold) {
  Workload workload = valid();
  Task &task = workload.dags[0].tasks[0];
  const auto mistake = [&](Callback callback) {
    task.callback = std::move(callback);
    return to_string(validate(workload));
  };
  using Kind = Callback::Kind;
  const auto none = std::nullopt;
  EXPECT_EQ(mistake({"/n", Kind::Timer, "", 0, none}), "");
  EXPECT_EQ(mistake({"/n", Kind::Timer, "/x", 0, none}), "error: the timer of task 'a' cannot have a name");
  EXPECT_EQ(mistake({"/n", Kind::Timer, "", -1, none}), "error: the timer of task 'a' cannot have period -1ns");
  EXPECT_EQ(mistake({"/n", Kind::Service, "/x", 5, none}), "error: the service of task 'a' cannot have period 5ns");
  EXPECT_EQ(mistake({"/n", Kind::Action, "/x", 0, 3}), "error: the action of task 'a' cannot have an index");
  EXPECT_NE(mistake({"/n", Kind::Action, "", 0, none}).find("action '' of the callback of task 'a' is empty"),
            std::string::npos);
}

TEST(Validate, LeavesOnlyTheWcetOfCallbacksOpen) {
  Workload workload = valid();
  for (Task &task : workload.dags[0].tasks) task.wcet = 0;
  workload.dags[0].tasks[0].callback = Callback{"/n", Callback::Kind::Timer, "", 0, std::nullopt};
  EXPECT_EQ(validate(workload).size(), 2U);
  EXPECT_EQ(to_string(validate(workload, {.wcet_optional = true})),
            "error: wcet of task 'b' must be greater than zero, not 0s");
  workload.dags[0].tasks[0].wcet = -1;
  EXPECT_EQ(validate(workload, {.wcet_optional = true}).size(), 2U);
}

TEST(Validate, WantsInheritedPeriods) {
  Workload workload = valid();
  workload.dags[0].tasks[1].period = 5 * kMillisecond;
  const std::string found = to_string(validate(workload));
  EXPECT_NE(found.find("period 5ms of data task 'b' is not 10ms, the largest period of its predecessors"),
            std::string::npos)
      << found;
}

TEST(Validate, NamesEveryCycle) {
  Workload workload = valid();
  Dag &dag = workload.dags[0];
  const Task data = dag.tasks[1];
  dag.tasks.clear();
  const auto add = [&](const char *name, std::vector<std::uint32_t> predecessors) {
    Task task = data;
    task.name = name;
    task.predecessors = std::move(predecessors);
    dag.tasks.push_back(task);
  };
  add("a", {1});
  add("b", {0});
  add("c", {4});
  add("d", {2});
  add("e", {3});
  add("free", {0});
  const std::string found = to_string(validate(workload));
  EXPECT_NE(found.find("a -> b -> a"), std::string::npos) << found;
  EXPECT_NE(found.find("c -> d -> e -> c"), std::string::npos) << found;
}

TEST(Validate, ShortensALongCycle) {
  Workload workload = valid();
  Dag &dag = workload.dags[0];
  constexpr std::uint32_t kCount = 100'000;
  dag.tasks.assign(kCount, dag.tasks[1]);
  for (std::uint32_t i = 0; i < kCount; ++i) {
    dag.tasks[i].name = "t" + std::to_string(i);
    dag.tasks[i].predecessors = {(i + kCount - 1) % kCount};
  }
  EXPECT_NE(to_string(validate(workload)).find("t11 -> (99988 more) -> t0"), std::string::npos);
}

TEST(Validate, PointsAtTheFieldAndTheItem) {
  Workload workload = valid();
  workload.dags[0].tasks[1].predecessors = {0, 1};
  const std::vector<Finding> findings = find_mistakes(workload);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].dag, DagId(0));
  EXPECT_EQ(findings[0].task, 1U);
  EXPECT_EQ(findings[0].field, Field::After);
  EXPECT_EQ(findings[0].item, 1U);
  EXPECT_TRUE(findings[0].involves.intersects(Field::After));
}

// No workload causes a crash, and a workload that passes has the properties on which all other code relies.
RC_GTEST_PROP(Validate, PassesOnlyWhatIsSound, ()) {
  Workload workload = valid();
  Dag &dag = workload.dags[0];
  const auto number = [] {
    return *rc::gen::oneOf(rc::gen::inRange<Duration>(-2, 20), rc::gen::arbitrary<Duration>(),
                           rc::gen::element<Duration>(INT64_MIN, INT64_MAX, kMaxDuration));
  };
  dag.tasks.resize(*rc::gen::inRange<std::size_t>(0, 5));
  for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
    Task &task = dag.tasks[i];
    task.name = std::string(1, static_cast<char>('a' + i));
    task.wcet = number();
    task.bcet = number();
    task.period = number();
    task.deadline = number();
    task.jitter = number();
    task.offset = number();
    task.activation = *rc::gen::element(Activation::Timer, Activation::Data);
    task.concurrency = *rc::gen::element(0U, 1U, 2U, UINT32_MAX);
    task.group = *rc::gen::element<std::string>("", "g");
    if (*rc::gen::arbitrary<bool>()) {
      using Kind = Callback::Kind;
      const auto name = [] { return *rc::gen::element<std::string>("", "/", "/a", "a", "*", "/a//b", "\xff"); };
      task.callback = Callback{name(), *rc::gen::element(Kind::Timer, Kind::Service, Kind::Waitable), name(), number(),
                               *rc::gen::element<std::optional<std::uint32_t>>(std::nullopt, 0U, UINT32_MAX)};
    }
    task.execution.kind = *rc::gen::element(ExecutionTime::Kind::Constant, ExecutionTime::Kind::Normal);
    task.execution.mean = number();
    task.execution.stddev = number();
    task.predecessors = *rc::gen::container<std::vector<std::uint32_t>>(rc::gen::inRange(0U, 6U));
  }
  if (*rc::gen::inRange(0, 2) == 0) {
    for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {  // makes valid ones frequent enough
      dag.tasks[i] = valid().dags[0].tasks[0];
      dag.tasks[i].name = std::string(1, static_cast<char>('a' + i));
      if (i > 0) dag.tasks[i].predecessors = {*rc::gen::inRange(0U, i)};
    }
  }
  if (has_errors(validate(workload))) return;
  RC_ASSERT(topological_ranks(dag).size() == dag.tasks.size());
  for (const Task &task : dag.tasks) {
    RC_ASSERT(task.wcet > 0 && task.period > 0 && task.deadline > 0);
    RC_ASSERT(task.bcet >= 0 && task.bcet <= task.wcet);
    RC_ASSERT(task.concurrency >= 1 && (task.concurrency == 1 || task.group.empty()));
  }
}

}  // namespace
}  // namespace redag
