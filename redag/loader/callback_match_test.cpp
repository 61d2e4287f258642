// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/callback_match.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace redag {
namespace {

using Kind = Callback::Kind;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

CallbackId of(Kind kind, std::string node, std::string name = "") {
  return CallbackId{kind, std::move(node), std::move(name), 0, 0};
}
CallbackId subscription(std::string node, std::string topic) {
  return of(Kind::Subscription, std::move(node), std::move(topic));
}
CallbackId timer(std::string node, Duration period, std::uint32_t index) {
  return CallbackId{Kind::Timer, std::move(node), "", period, index};
}
CallbackId service(std::string node, std::string name) { return of(Kind::Service, std::move(node), std::move(name)); }

// --- patterns ---

TEST(GlobMatch, StarIsAnyRunAndQuestionMarkIsOne) {
  EXPECT_TRUE(glob_match("", ""));
  EXPECT_TRUE(glob_match("*", ""));
  EXPECT_TRUE(glob_match("*", "/nav/planner"));
  EXPECT_TRUE(glob_match("/lidar_*", "/lidar_"));
  EXPECT_TRUE(glob_match("/lidar_*", "/lidar_front/driver"));
  EXPECT_TRUE(glob_match("*/planner", "/robot_1/nav/planner"));
  EXPECT_TRUE(glob_match("/camera_?", "/camera_2"));
  EXPECT_TRUE(glob_match("/*_?/**", "/a_b_c/d"));
  EXPECT_FALSE(glob_match("", "/a"));
  EXPECT_FALSE(glob_match("?", ""));
  EXPECT_FALSE(glob_match("/ekf", "/ekf2"));
  EXPECT_FALSE(glob_match("/ekf", "/ek"));
  EXPECT_FALSE(glob_match("/camera_?", "/camera_12"));
  EXPECT_FALSE(glob_match("*/planner", "/planner/x"));
}

TEST(GlobMatch, DoesNotBacktrackExponentially) {
  std::string pattern;
  for (int i = 0; i < 100; ++i) pattern += "*a";
  pattern += "*b";
  EXPECT_FALSE(glob_match(pattern, std::string(10'000, 'a')));  // 2e6 steps; full backtracking would never end
}

/// The definition of a match, taken literally.
bool naive_match(std::string_view pattern, std::string_view text) {
  if (pattern.empty()) return text.empty();
  if (pattern.front() == '*') {
    for (std::size_t taken = 0; taken <= text.size(); ++taken) {
      if (naive_match(pattern.substr(1), text.substr(taken))) return true;
    }
    return false;
  }
  if (text.empty() || (pattern.front() != '?' && pattern.front() != text.front())) return false;
  return naive_match(pattern.substr(1), text.substr(1));
}

RC_GTEST_PROP(GlobMatch, IsTheDefinition, ()) {
  const auto letters = [](std::string_view alphabet, int longest) {
    std::string text;
    const int length = *rc::gen::inRange(0, longest);
    for (int i = 0; i < length; ++i) text += alphabet[*rc::gen::inRange<std::size_t>(0, alphabet.size())];
    return text;
  };
  const std::string text = letters("ab", 12);
  std::string pattern = letters("ab**?", 9);
  if (*rc::gen::arbitrary<bool>()) {  // made from the text, so that enough patterns match
    pattern = text;
    const int holes = *rc::gen::inRange(0, 4);
    for (int i = 0; i < holes && !pattern.empty(); ++i) {
      const auto at = *rc::gen::inRange<std::size_t>(0, pattern.size());
      if (*rc::gen::arbitrary<bool>()) {
        pattern[at] = '?';
      } else {
        pattern.replace(at, *rc::gen::inRange<std::size_t>(0, 4), "*");
      }
    }
  }
  const bool expected = naive_match(pattern, text);
  RC_CLASSIFY(expected);
  RC_ASSERT(glob_match(pattern, text) == expected);
}

TEST(Matches, EveryPartThatIsGiven) {
  const Callback any_timer{"/a", Kind::Timer, "", 0, std::nullopt};
  EXPECT_TRUE(matches(any_timer, timer("/a", 5, 7)));
  EXPECT_FALSE(matches(any_timer, timer("/b", 5, 7)));
  const Callback with_period{"/*", Kind::Timer, "", 5, std::nullopt};
  EXPECT_TRUE(matches(with_period, timer("/a", 5, 7)));
  EXPECT_FALSE(matches(with_period, timer("/a", 6, 7)));
  const Callback with_index{"/a", Kind::Timer, "", 0, 0};
  EXPECT_TRUE(matches(with_index, timer("/a", 5, 0)));
  EXPECT_FALSE(matches(with_index, timer("/a", 5, 1)));
  const Callback topic{"/a", Kind::Subscription, "/imu/*", 0, std::nullopt};
  EXPECT_TRUE(matches(topic, subscription("/a", "/imu/data")));
  EXPECT_FALSE(matches(topic, subscription("/a", "/gps")));
  EXPECT_FALSE(matches(topic, service("/a", "/imu/data")));
  EXPECT_FALSE(matches(any_timer, of(Kind::Waitable, "/a")));
}

TEST(ToString, NamesACallback) {
  EXPECT_EQ(to_string(subscription("/ekf", "/imu/data")), "/ekf subscription /imu/data");
  EXPECT_EQ(to_string(timer("/imu_driver", 2 * kMillisecond, 0)), "/imu_driver timer 2 ms (0)");
  EXPECT_EQ(to_string(timer("/t", 1'500'000, 3)), "/t timer 1.5 ms (3)");
  EXPECT_EQ(to_string(CallbackId{Kind::Waitable, "/camera", "", 0, 1}), "/camera waitable (1)");
  EXPECT_EQ(to_string(Callback{"/lidar_*", Kind::Timer, "", 0, std::nullopt}), "/lidar_* timer");
  EXPECT_EQ(to_string(Callback{"/lidar_*", Kind::Timer, "", kSecond, 2}), "/lidar_* timer 1 s (2)");
  EXPECT_EQ(to_string(Callback{"/n", Kind::Action, "/go", 0, std::nullopt}), "/n action /go");
}

TEST(RosNameMistake, SaysWhatIsWrong) {
  for (const char *name : {"/a", "/a/b_2", "*", "?a", "*/planner", "/lidar_*/x?", "/_hidden"}) {
    EXPECT_EQ(ros_name_mistake(name), "") << name;
  }
  EXPECT_EQ(ros_name_mistake(""), "is empty");
  EXPECT_EQ(ros_name_mistake("ekf"), "does not begin with '/'");
  EXPECT_EQ(ros_name_mistake("/"), "ends with '/'");
  EXPECT_EQ(ros_name_mistake("/a/"), "ends with '/'");
  EXPECT_EQ(ros_name_mistake("/a//b"), "contains '//'");
  EXPECT_EQ(ros_name_mistake("~/imu"), "contains '~', which a ROS name cannot contain");
  EXPECT_EQ(ros_name_mistake("/caf\xC3\xA9"), "contains byte 0xc3, which a ROS name cannot contain");
}

TEST(IsRosInternal, KnowsWhatEveryNodeHas) {
  EXPECT_TRUE(is_ros_internal(subscription("/ekf", "/parameter_events")));
  EXPECT_TRUE(is_ros_internal(subscription("/ekf", "/clock")));
  EXPECT_TRUE(is_ros_internal(subscription("/ekf", "/rosout")));
  EXPECT_TRUE(is_ros_internal(service("/ekf", "/ekf/get_parameters")));
  EXPECT_TRUE(is_ros_internal(service("/nav/ekf", "/nav/ekf/set_parameters_atomically")));
  EXPECT_TRUE(is_ros_internal(service("/ekf", "/ekf/change_state")));
  EXPECT_TRUE(is_ros_internal(service("/box", "/box/_container/load_node")));
  EXPECT_FALSE(is_ros_internal(subscription("/ekf", "/imu/data")));
  EXPECT_FALSE(is_ros_internal(subscription("/ekf", "/robot/clock")));
  EXPECT_FALSE(is_ros_internal(service("/ekf", "/ekf/reset")));
  EXPECT_FALSE(is_ros_internal(service("/ekf", "/map/get_state")));
  EXPECT_FALSE(is_ros_internal(service("/ekf", "/ekf")));
  EXPECT_FALSE(is_ros_internal(of(Kind::Client, "/gui", "/gui/get_parameters")));
  EXPECT_FALSE(is_ros_internal(timer("/clock", 5, 0)));
  EXPECT_FALSE(is_ros_internal(of(Kind::Waitable, "/arm")));
  EXPECT_TRUE(is_ros_internal(of(Kind::Waitable, "/arm", "timer")));  // expires the goals of an action server
}

// --- the matcher ---

/// Two DAGs: `callbacks` go to tasks t0, t1, ... of DAG "control", the last one to task "last" of DAG "other".
Workload workload_of(const std::vector<Callback> &callbacks) {
  Workload workload;
  workload.dags.resize(2);
  workload.dags[0].name = "control";
  workload.dags[1].name = "other";
  for (std::size_t i = 0; i < callbacks.size(); ++i) {
    const bool last = i + 1 == callbacks.size();
    Task task;
    task.name = last ? "last" : "t" + std::to_string(i);
    task.callback = callbacks[i];
    workload.dags[last ? 1 : 0].tasks.push_back(task);
  }
  workload.dags[0].tasks.emplace_back().name = "synthetic";  // without a callback: never found, never reported
  return workload;
}

Callback of_timer(std::string node, Duration period = 0, std::optional<std::uint32_t> index = {}) {
  return Callback{std::move(node), Kind::Timer, "", period, index};
}
Callback of_topic(std::string node, std::string topic) {
  return Callback{std::move(node), Kind::Subscription, std::move(topic), 0, std::nullopt};
}

std::string found(CallbackMatcher &matcher, const CallbackId &id) {
  const std::optional<TaskRef> ref = matcher.find(id);
  return ref ? ref->task->name : "-";
}

TEST(CallbackMatcher, FindsTheTaskAndItsIds) {
  const Workload workload = workload_of({of_topic("/ekf", "/imu"), of_topic("/ekf", "/gps"), of_timer("/pid")});
  CallbackMatcher matcher(workload);
  const std::optional<TaskRef> ref = matcher.find(timer("/pid", kMillisecond, 0));
  ASSERT_TRUE(ref);
  EXPECT_EQ(ref->task, &workload.dags[1].tasks[0]);
  EXPECT_EQ(ref->dag, DagId(1));
  EXPECT_EQ(ref->index, 0U);
  EXPECT_EQ(ref->id, TaskId(3));  // after t0, t1 and the synthetic one
  EXPECT_EQ(found(matcher, subscription("/ekf", "/gps")), "t1");
  EXPECT_EQ(found(matcher, subscription("/ekf", "/odom")), "-");
}

TEST(CallbackMatcher, ExactNodesWinThenTheFirstInTheFile) {
  const Workload workload = workload_of(
      {of_timer("*"), of_timer("/lidar_*"), of_timer("/lidar_1", 5), of_timer("/lidar_1"), of_timer("/lidar_1")});
  CallbackMatcher matcher(workload);
  EXPECT_EQ(found(matcher, timer("/lidar_1", 5, 0)), "t2");
  EXPECT_EQ(found(matcher, timer("/lidar_1", 6, 1)), "t3");
  EXPECT_EQ(found(matcher, timer("/lidar_2", 6, 0)), "t0");
  EXPECT_THAT(matcher.unmatched(),
              ElementsAre("control.t1: its callback, /lidar_1 timer 5 ns (0), belongs to control.t2 already",
                          "other.last: its callback, /lidar_1 timer 5 ns (0), belongs to control.t2 already"));
}

TEST(CallbackMatcher, AnExactNodeThatDoesNotMatchLeavesThePatterns) {
  const Workload workload = workload_of({of_topic("*", "/imu"), of_topic("/ekf", "/gps")});
  CallbackMatcher matcher(workload);
  EXPECT_EQ(found(matcher, subscription("/ekf", "/imu")), "t0");
}

TEST(CallbackMatcher, OneTaskCanRunManyCallbacks) {
  const Workload workload = workload_of({of_topic("/camera_?", "*"), of_timer("/x")});
  CallbackMatcher matcher(workload);
  EXPECT_EQ(found(matcher, subscription("/camera_1", "/a")), "t0");
  EXPECT_EQ(found(matcher, subscription("/camera_2", "/b")), "t0");
}

TEST(CallbackMatcher, NamesTheNearestCallback) {
  const Workload workload =
      workload_of({of_topic("/ekf", "/imu/dta"), of_timer("/pid", 2 * kMillisecond), of_timer("/pdi", 0, 0),
                   of_topic("/robot/ekf", "/imu/data"), Callback{"/gui", Kind::Service, "/reset", 0, std::nullopt},
                   of_timer("/nowhere")});
  CallbackMatcher matcher(workload);
  EXPECT_THAT(matcher.unmatched(),
              ::testing::Contains("control.t0: no callback matches /ekf subscription /imu/dta"));  // nothing seen yet
  found(matcher, subscription("/ekf", "/odometry"));
  found(matcher, subscription("/ekf", "/imu/data"));
  found(matcher, timer("/pid", 5 * kMillisecond, 0));
  found(matcher, of(Kind::Client, "/gui", "/reset"));
  EXPECT_THAT(
      matcher.unmatched(),
      ElementsAre(
          "control.t0: no callback matches /ekf subscription /imu/dta; nearest: /ekf subscription /imu/data",
          "control.t1: no callback matches /pid timer 2 ms; nearest: /pid timer 5 ms (0)",
          "control.t2: no callback matches /pdi timer (0); nearest: /pid timer 5 ms (0)",
          "control.t3: no callback matches /robot/ekf subscription /imu/data; nearest: /ekf subscription /imu/data",
          "control.t4: no callback matches /gui service /reset; nearest: /gui client /reset",
          "other.last: no callback matches /nowhere timer"));
}

TEST(CallbackMatcher, ForgetsAMismatchOnceTheCallbackComes) {
  const Workload workload = workload_of({of_topic("/ekf", "/imu"), of_timer("/pid")});
  CallbackMatcher matcher(workload);
  EXPECT_EQ(matcher.unmatched().size(), 2U);
  found(matcher, timer("/pid", kMillisecond, 0));
  EXPECT_THAT(matcher.unmatched(), ElementsAre("control.t0: no callback matches /ekf subscription /imu"));
  found(matcher, subscription("/ekf", "/imu"));
  EXPECT_THAT(matcher.unmatched(), IsEmpty());
}

TEST(CallbackMatcher, ATaskThatNamesACallbackOfRosGetsIt) {
  const Workload workload = workload_of({of_topic("/ekf", "/imu"), of_topic("/ekf", "/rosout")});
  CallbackMatcher matcher(workload);
  EXPECT_EQ(found(matcher, subscription("/ekf", "/parameter_events")), "-");
  EXPECT_EQ(found(matcher, subscription("/ekf", "/rosout")), "last");
}

// Compares with the literal rule: the first match in file order among tasks with an exact node, otherwise among all.
RC_GTEST_PROP(CallbackMatcher, FollowsTheRule, ()) {
  const auto node = [](bool pattern) {
    return pattern ? *rc::gen::element<std::string>("/a", "/b", "/a_1", "/a_?", "/*", "*", "/a*")
                   : *rc::gen::element<std::string>("/a", "/b", "/a_1", "/a_2", "/c");
  };
  std::vector<Callback> callbacks(*rc::gen::inRange<std::size_t>(1, 7));
  for (Callback &callback : callbacks) {
    callback.node = node(true);
    callback.kind = *rc::gen::element(Kind::Timer, Kind::Subscription);
    if (callback.kind == Kind::Subscription) {
      callback.name = *rc::gen::element<std::string>("/x", "/y", "*");
    } else {
      callback.period = *rc::gen::element<Duration>(0, 1, 2);
      if (*rc::gen::arbitrary<bool>()) callback.index = *rc::gen::inRange(0U, 2U);
    }
  }
  const Workload workload = workload_of(callbacks);
  CallbackMatcher matcher(workload);
  std::vector<bool> used(callbacks.size(), false);
  const int count = *rc::gen::inRange(0, 8);
  for (int i = 0; i < count; ++i) {
    const CallbackId id = *rc::gen::arbitrary<bool>()
                              ? subscription(node(false), *rc::gen::element<std::string>("/x", "/y", "/z"))
                              : timer(node(false), *rc::gen::element<Duration>(1, 2, 3), *rc::gen::inRange(0U, 3U));
    std::optional<std::size_t> expected;
    for (const bool exact : {true, false}) {
      for (std::size_t k = 0; k < callbacks.size() && !expected; ++k) {
        if ((!exact || callbacks[k].node == id.node) && matches(callbacks[k], id)) expected = k;
      }
    }
    const std::optional<TaskRef> ref = matcher.find(id);
    RC_ASSERT(ref.has_value() == expected.has_value());
    if (expected) {
      used[*expected] = true;
      RC_ASSERT(*ref->task->callback == callbacks[*expected]);
      RC_ASSERT(ref->task->name == (*expected + 1 == callbacks.size() ? "last" : "t" + std::to_string(*expected)));
    }
  }
  RC_ASSERT(matcher.unmatched().size() == static_cast<std::size_t>(std::count(used.begin(), used.end(), false)));
}

}  // namespace
}  // namespace redag
