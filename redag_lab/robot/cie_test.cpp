// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/cie.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/model/text_file.hpp"
#include "redag_lab/robot/input.hpp"
#include "redag_lab/robot/plan.hpp"
#include "redag_testing/repository.hpp"

namespace redag::robot::cie {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::size_t count_of(std::string_view word, std::string_view text) {
  std::size_t count = 0;
  for (std::size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

Imported imported_from(const std::string &text) {
  Result<Imported> imported = import_robot(text, "groups.yaml");
  EXPECT_TRUE(imported) << to_string(imported.error());
  if (!imported) return {};
  // One explains the word, and names in quotes are no gaps.
  EXPECT_EQ(count_of("TODO", imported->text) - count_of("\"TODO\"", imported->text), imported->to_fill_in + 1)
      << imported->text;
  return *std::move(imported);
}

std::string mistakes_of(const std::string &text) {
  const Result<Imported> imported = import_robot(text, "groups.yaml");
  return imported ? "none" : to_string(imported.error());
}

// What a user writes for TODO, line by line.
std::string filled_in(std::string text) {
  const std::vector<std::pair<std::string, std::string>> values = {{"match: TODO", "match: {name: node}"},
                                                                   {"wcet: TODO", "wcet: 100us"},
                                                                   {"period: TODO", "period: 100ms"},
                                                                   {"cpus: TODO", "cpus: 0-3"},
                                                                   {"level: TODO", "level: {fifo: 85}"}};
  for (const auto &[from, to] : values) {
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
      text.replace(at, from.size(), to);
    }
  }
  return text;
}

std::string read(const std::string &name) {
  const Result<std::string> text =
      read_text_file(testing::repository() / "examples" / "import" / name, "a configuration", kMaxWorkloadBytes);
  EXPECT_TRUE(text);
  return text.value_or("");
}

TEST(Cie, TheShippedExampleBecomesARobot) {
  const Imported imported = imported_from(read("callback_groups.yaml"));
  EXPECT_EQ(imported.text, R"(# Made by 'redag import' from groups.yaml, a configuration of callback_isolated_executor.
# TODO stands for what the configuration does not say. 'redag validate' names each such line.
robot: imported
policy: fixed  # by the priorities of the configuration; with rate_monotonic, the rates decide
cpu_sets:
  - {name: "cpus 0-1", cpus: "0-1"}
  - {name: "cpus 2", cpus: "2"}
# A process for each node: move the DAGs of nodes that share a container into one process.
processes:
  - name: lidar
    match: TODO  # such as {command: "*__node:=lidar*"}
    cpus: "cpus 0-1"
    workload:
      policy: fixed
      platform: {preemption: os}
      dags:
        - name: lidar
          tasks:
            # line 19: SCHED_FIFO 60 on processors 0-1
            - {name: subscription_scan, wcet: TODO, period: TODO, priority: 60, group: group_1, callback: {node: /lidar, subscription: /scan}}
            - {name: service_lidar/reset, wcet: TODO, period: TODO, priority: 60, group: group_1, callback: {node: /lidar, service: /lidar/reset}}
  - name: logger
    match: TODO  # such as {command: "*__node:=logger*"}
    cpus: "cpus 2"
    workload:
      policy: fixed
      platform: {preemption: os}
      dags:
        - name: logger
          tasks:
            # line 24: SCHED_OTHER with nice 5 on processors 2
            - {name: timer_1s, wcet: TODO, period: 1s, priority: -26, callback: {node: /logger, timer: 1s}}
  - name: wheels
    match: TODO  # such as {command: "*__node:=wheels*"}
    cpus: "cpus 0-1"
    workload:
      policy: fixed
      platform: {preemption: os}
      dags:
        - name: wheels
          tasks:
            # line 14: SCHED_FIFO 80 on processors 0-1
            - {name: timer_5ms, wcet: TODO, period: 5ms, priority: 80, callback: {node: /wheels, timer: 5ms}}
threads:
  # line 30: SCHED_FIFO 90 on processors 0
  - {name: can_rx, match: {thread: can_rx}, level: above, wcet: TODO, period: TODO, cpus: "0"}
)");
  EXPECT_EQ(imported.to_fill_in, 11U);
  EXPECT_THAT(imported.remarks, ElementsAre("left out: 3 callbacks for parameters of nodes, which get the default "
                                            "period of the executor"));
}

// A file with gaps is refused, line by line. Without gaps it has an order, and bounds.
TEST(Cie, GapsAreMistakesOfTheRobotFile) {
  const Imported imported = imported_from(read("callback_groups.yaml"));
  const Result<Input> gaps = parse_input(imported.text, "robot.yaml");
  ASSERT_FALSE(gaps);
  const std::string mistakes = to_string(gaps.error());
  EXPECT_EQ(count_of("'TODO'", mistakes), imported.to_fill_in) << mistakes;
  EXPECT_THAT(mistakes, HasSubstr("robot.yaml:20:47: error: wcet: 'TODO' is not a duration"));

  const Result<Input> filled = parse_input(filled_in(imported.text), "robot.yaml");
  ASSERT_TRUE(filled) << to_string(filled.error());
  const Result<Plan> plan = plan_of(*filled->robot, runtime::band_up_to(90));
  ASSERT_TRUE(plan) << to_string(plan.error());
  ASSERT_EQ(plan->levels.size(), 3U);
  EXPECT_THAT(plan->levels[0].members, ElementsAre("wheels.wheels.timer_5ms"));
  EXPECT_THAT(plan->levels[2].members, ElementsAre("logger.logger.timer_1s"));
}

TEST(Cie, KeepsTimesOfReservations) {
  const Imported imported = imported_from(R"(callback_groups:
  - {id: /a@Subscription(/x), affinity: ~, policy: SCHED_DEADLINE, runtime: 2000000, period: 10000000, deadline: 8000000}
non_ros_threads:
  - {name: vendor, affinity: [1], policy: SCHED_DEADLINE, runtime: 1000000, period: 5000000, deadline: 5000000}
  - {name: odd, affinity: ~, policy: SCHED_DEADLINE, runtime: 1000000, period: 5000000, deadline: 4000000}
)");
  EXPECT_THAT(imported.text, HasSubstr("cpus: TODO  # the processors"));
  EXPECT_THAT(imported.text,
              HasSubstr("{name: subscription_x, wcet: 2ms, period: 10ms, deadline: 8ms, priority: 100, "));
  EXPECT_THAT(imported.text, HasSubstr("{name: vendor, match: {thread: vendor}, level: {reservation: {budget: 1ms, "
                                       "period: 5ms}}}"));
  EXPECT_THAT(imported.text, HasSubstr("{name: odd, match: {thread: odd}, level: TODO}"));
  EXPECT_THAT(imported.remarks, ElementsAre(HasSubstr("groups.yaml:4: thread 'vendor' may run on all processors")));
}

// The priorities of tasks become those of the robot, so that a thread's own number would mean another place.
TEST(Cie, ThreadsKeepTheirPlaceAmongTasks) {
  const auto level_with = [](const std::string &policy) {
    return imported_from(
               "callback_groups:\n  - {id: /a@Timer(5), policy: SCHED_FIFO, priority: 50}\n"
               "  - {id: /a@Timer(6), policy: SCHED_RR, priority: 30}\n"
               "non_ros_threads:\n  - {id: x, policy: " +
               policy + "}\n")
        .text;
  };
  EXPECT_THAT(level_with("SCHED_FIFO, priority: 51"), HasSubstr("level: above, wcet: TODO, period: TODO"));
  EXPECT_THAT(level_with("SCHED_RR, priority: 29"), HasSubstr("level: below}"));
  EXPECT_THAT(level_with("SCHED_FIFO, priority: 40"), HasSubstr("level: TODO}"));
  EXPECT_THAT(level_with("SCHED_FIFO, priority: 50"), HasSubstr("level: TODO}"));
  EXPECT_THAT(level_with("SCHED_BATCH, nice: -4"), HasSubstr("level: {nice: -4}"));
  EXPECT_THAT(level_with("SCHED_IDLE, priority: 0"), HasSubstr("level: {nice: 19}"));
}

// What Agnocast's variant and earlier versions write.
TEST(Cie, KnowsOtherVersions) {
  const Imported imported = imported_from(R"(rt_throttling: {runtime_us: 950000, period_us: 1000000}
callback_groups:
  - {id: "/ns/a/*", domain_id: 3, policy: SCHED_OTHER, nice: 0}
  - {id: /ns/a@Timer(1000000)@Timer(1000000)@Waitable@Waitable, domain_id: 3, policy: SCHED_FIFO, priority: 9}
  - {id: /ns/a@Waitable, policy: SCHED_FIFO, priority: 8}
  - {id: /b, policy: SCHED_FIFO, priority: 7, affinity: []}
non_ros_threads: []
kernel_threads:
  - {comm: ksoftirqd/0, affinity: UNMANAGEABLE, policy: SCHED_OTHER, nice: 0}
  - {comm: irq/24-a_device_with_a_long_name, affinity: [1, 0], policy: UNMANAGEABLE}
  - {comm: migration/0, affinity: UNMANAGEABLE}
irqs:
  - {irq: 24, name: eth0, affinity: [1]}
  - {irq: 25, affinity: ~}
)");
  EXPECT_THAT(imported.text, HasSubstr("name: ns/a_2  # ROS_DOMAIN_ID 3"));
  EXPECT_THAT(imported.text, HasSubstr("name: ns/a\n")) << "the same node without a stated domain";
  EXPECT_THAT(imported.text, HasSubstr("{name: others, wcet: TODO, period: TODO, priority: -21}"));
  EXPECT_EQ(count_of("timer_1ms", imported.text), 1U) << "one task has both timers";
  EXPECT_THAT(imported.text, HasSubstr("{name: waitables, wcet: TODO, period: TODO, priority: 8, callback: {node: "
                                       "/ns/a, waitable: any}}"));
  EXPECT_THAT(imported.text, HasSubstr("{name: irq/24-a_device_with_a_long_name, match: {thread: irq/24-a_device}, "
                                       "cpus: \"0-1\"}"));
  EXPECT_THAT(imported.text, Not(HasSubstr("migration")));
  EXPECT_THAT(imported.text, HasSubstr("irqs:\n  - {name: irq_24, match: \"24\", cpus: \"1\"}\n"));
  EXPECT_THAT(imported.text, Not(HasSubstr("irq_25")));
}

TEST(Cie, ReportsEveryMistakeAtItsLine) {
  EXPECT_EQ(mistakes_of(R"(callback_groups:
  - {id: a@Timer(5), policy: SCHED_FIFO, priority: 50}
  - {id: /a@Timer(x), policy: SCHED_FIFO, priority: 50}
  - {id: /a@Topic(/x), policy: SCHED_FIFO, priority: 50}
  - {id: /a@Timer(5), policy: SCHED_FIFA, priority: 50}
  - {id: /a@Timer(5), policy: SCHED_FIFO, priority: 100}
  - {id: /b, policy: SCHED_FIFO}
  - {id: /c, policy: SCHED_DEADLINE, runtime: 5, period: 10}
  - {id: /d/*/e, policy: SCHED_OTHER, priority: 0, color: red}
  - {policy: SCHED_OTHER}
non_ros_threads:
  - {name: x, affinity: two, policy: SCHED_OTHER, priority: 0}
  - {name: x, policy: SCHED_OTHER, priority: -30}
)"),
            R"(groups.yaml:2:10: error: the name 'a' does not begin with '/'
groups.yaml:3:10: error: the period of 'Timer(x)' is no number of nanoseconds (such as Timer(10000000))
groups.yaml:4:10: error: 'Topic(/x)' in the id of a callback group is no callback (known are Subscription(TOPIC), Service(NAME), Client(NAME), Timer(NANOSECONDS) and Waitable)
groups.yaml:5:31: error: policy must be one of SCHED_OTHER, SCHED_BATCH, SCHED_IDLE, SCHED_FIFO, SCHED_RR, SCHED_DEADLINE, not 'SCHED_FIFA' (did you mean 'SCHED_FIFO'?)
groups.yaml:6:10: error: callback group '/a@Timer(5)' is listed twice (remove one of the entries)
groups.yaml:6:53: error: priority must be a whole number from 1 to 99, not '100'
groups.yaml:7:5: error: an entry with SCHED_FIFO needs 'priority'
groups.yaml:8:5: error: an entry with SCHED_DEADLINE needs 'deadline', in nanoseconds
groups.yaml:9:10: error: '*' in '/d/*/e' stands for nothing (an id for all groups of a node ends with '/*', as in '/planner/*')
groups.yaml:9:52: error: unknown key 'color' in a callback group (known: id, domain_id, affinity, policy, priority, nice, runtime, period, deadline)
groups.yaml:10:5: error: a callback group needs its id (such as '/node@Timer(10000000)')
groups.yaml:12:25: error: affinity must be a list of processors such as 0-3 or [0, 2-5], not 'two'
groups.yaml:13:12: error: thread 'x' is listed twice (remove one of the entries)
groups.yaml:13:46: error: priority must be a whole number from -20 to 19, not '-30')");
  EXPECT_THAT(mistakes_of("robot: cart\n"), HasSubstr("groups.yaml:1:1: error: unknown key 'robot'"));
  EXPECT_THAT(mistakes_of("hardware_info: {}\n"), HasSubstr("this is no configuration of callback_isolated_executor"));
  EXPECT_THAT(mistakes_of(""), HasSubstr("a configuration of callback_isolated_executor must be a map"));
  EXPECT_THAT(mistakes_of("callback_groups: [a, b"), HasSubstr("groups.yaml:"));
}

TEST(Cie, QuotesWhatIsNoPlainName) {
  const Imported imported = imported_from(
      "non_ros_threads:\n  - {name: 'null', policy: SCHED_OTHER, priority: 0}\n"
      "  - {name: 'rx}: \"1\" #', policy: SCHED_OTHER, priority: 0}\n  - {name: '7', policy: SCHED_OTHER, priority: "
      "0}\n"
      "  - {name: TODO, policy: SCHED_OTHER, priority: 0}\n");
  const Result<yaml::Node> parsed = yaml::parse(imported.text, "robot.yaml");
  ASSERT_TRUE(parsed) << to_string(parsed.error()) << imported.text;
  for (const char *name : {"\"null\"", R"("rx}: \"1\" #")", "\"7\"", "\"TODO\""}) {
    EXPECT_THAT(imported.text, HasSubstr(fmt::format("{{name: {0}, match: {{thread: {0}}}", name)));
  }
}

TEST(Cie, ReadsManyGroupsAndRefusesATextThatIsTooLong) {
  std::string text = "callback_groups:\n";
  for (int i = 0; i < 20000; ++i) {
    text += fmt::format("  - {{id: '/n{}@Subscription(/t{})', affinity: [{}], policy: SCHED_FIFO, priority: {}}}\n",
                        i % 900, i, i % 8, i % 99 + 1);
  }
  const Imported imported = imported_from(text);
  EXPECT_EQ(count_of("wcet: TODO", imported.text), 20000U);
  EXPECT_EQ(count_of("match: TODO", imported.text), 900U);
  EXPECT_THAT(mistakes_of(text + std::string(kMaxWorkloadBytes, ' ')), HasSubstr("is longer than"));
}

}  // namespace
}  // namespace redag::robot::cie
