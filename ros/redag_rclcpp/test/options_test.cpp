// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests how parameters become options: defaults, precedence, and messages about mistakes.
#include "redag_rclcpp/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "environment.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/threads/threads.hpp"
#include "redag_rclcpp/monitor.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using rclcpp::Parameter;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char *kWorkload = R"(name: robot
platform: {workers: 3, preemption: none}
policy: edf
ties: fixed
dags:
  - name: control
    tasks:
      - {name: imu, wcet: 1ms, callback: {node: /imu, timer: 5ms}}
      - {name: map, segments: [{cpu: 1ms}, {wait: 2ms}, {cpu: 1ms}], callback: {node: /map, timer: 10ms}}
)";

class OptionsTest : public ::testing::Test {
 protected:
  void SetUp() override { rclcpp::init(0, nullptr); }
  void TearDown() override {
    rclcpp::shutdown();
    for (const std::string &file : files_) std::filesystem::remove(file);
  }

  static rclcpp::Node::SharedPtr node_with(const std::vector<Parameter> &overrides) {
    return std::make_shared<rclcpp::Node>("node", rclcpp::NodeOptions().parameter_overrides(overrides));
  }
  static ReDAGOptions options_with(const std::vector<Parameter> &overrides) {
    return declare_options(*node_with(overrides));
  }
  static std::string mistake_with(const std::vector<Parameter> &overrides) {
    const auto node = node_with(overrides);
    try {
      const ReDAGOptions options = declare_options(*node);
      (void)declare_monitor_options(*node, options);
    } catch (const rclcpp::exceptions::InvalidParameterValueException &error) {
      return error.what();
    }
    return "none";
  }
  std::string file_with(const std::string &text) {
    files_.push_back(std::filesystem::temp_directory_path() / ("redag_options_test_" + std::to_string(getpid()) + "_" +
                                                               std::to_string(files_.size()) + ".yaml"));
    std::ofstream(files_.back()) << text;
    return files_.back();
  }

 private:
  std::vector<std::string> files_;
};

TEST_F(OptionsTest, Defaults) {
  const auto node = node_with({});
  const ReDAGOptions options = declare_options(*node);
  EXPECT_EQ(options.workers, 0U);
  EXPECT_EQ(options.preemption, redag::PreemptionMode::Auto);
  EXPECT_EQ(options.threads, 0U);
  EXPECT_TRUE(options.cpus.empty());
  EXPECT_FALSE(options.workload);
  EXPECT_EQ(options.default_period, 100ms);
  EXPECT_EQ(options.learn, 10s);
  EXPECT_TRUE(options.raise_middleware);
  EXPECT_FALSE(options.lock_memory);
  EXPECT_EQ(options.watchdog, 0ns);
  EXPECT_EQ(options.trace_capacity, 0U);

  const MonitorOptions monitor = declare_monitor_options(*node, options);
  EXPECT_EQ(monitor.period, 1s);
  EXPECT_TRUE(monitor.live);
  EXPECT_EQ(monitor.trace, "");
  EXPECT_FALSE(monitor.workload);
}

TEST_F(OptionsTest, ValuesAreRead) {
  const std::int64_t cpu = redag::runtime::usable_cpus().front();
  const auto node = node_with({{"workers", 2},
                               {"preemption", "cooperative"},
                               {"threads", 7},
                               {"cpu_affinity", std::vector<std::int64_t>{cpu}},
                               {"default_period", 0.02},
                               {"learn", 1.5},
                               {"raise_middleware", false},
                               {"lock_memory", true},
                               {"watchdog", 2},
                               {"live", false},
                               {"trace", "results"},
                               {"metrics_period", 0.25},
                               {"trace_events", 10},
                               {"save_path", "s.yaml"}});
  const ReDAGOptions options = declare_options(*node);
  EXPECT_EQ(options.workers, 2U);
  EXPECT_EQ(options.preemption, redag::PreemptionMode::Cooperative);
  EXPECT_EQ(options.threads, 7U);
  EXPECT_EQ(options.cpus, std::vector<int>{static_cast<int>(cpu)});
  EXPECT_EQ(options.default_period, 20ms);
  EXPECT_EQ(options.learn, 1500ms);
  EXPECT_FALSE(options.raise_middleware);
  EXPECT_TRUE(options.lock_memory);
  EXPECT_EQ(options.watchdog, 2s);
  EXPECT_GT(options.trace_capacity, 0U);

  const MonitorOptions monitor = declare_monitor_options(*node, options);
  EXPECT_EQ(monitor.period, 250ms);
  EXPECT_FALSE(monitor.live);
  EXPECT_EQ(monitor.trace, "results");
  EXPECT_EQ(monitor.trace_events, 10U);
  EXPECT_EQ(monitor.save_path, "s.yaml");
  EXPECT_EQ(monitor.default_period, 20ms);
}

TEST_F(OptionsTest, WholeSecondsNeedNoPoint) {
  EXPECT_EQ(options_with({{"learn", 5}}).learn, 5s);
  EXPECT_EQ(options_with({{"learn", 0}}).learn, 0s);
}

TEST_F(OptionsTest, TheWorkloadCountsWhereParametersAreAtTheirDefaults) {
  const std::string file = file_with(kWorkload);
  const ReDAGOptions from_file = options_with({{"config", file}});
  EXPECT_EQ(from_file.workers, 3U);
  EXPECT_EQ(from_file.preemption, redag::PreemptionMode::None);
  ASSERT_TRUE(from_file.workload);
  EXPECT_EQ((*from_file.workload)->name, "robot");
  EXPECT_EQ((*from_file.workload)->policy, redag::PolicyKind::Edf);
  EXPECT_EQ((*from_file.workload)->ties, redag::Ties::Fixed);
  EXPECT_EQ((*from_file.workload)->dags[0].tasks[1].waits.size(), 1U);
  const auto config = ReDAGExecutor(from_file).as_trace({}).info.config;
  EXPECT_EQ(config.policy, redag::PolicyKind::Edf);
  EXPECT_EQ(config.ties, redag::Ties::Fixed);

  const ReDAGOptions given = options_with({{"config", file}, {"workers", 1}, {"preemption", "cooperative"}});
  EXPECT_EQ(given.workers, 1U);
  EXPECT_EQ(given.preemption, redag::PreemptionMode::Cooperative);
}

TEST_F(OptionsTest, AFileThatSaysNoNumberOfWorkersLeavesItOpen) {
  std::string text = kWorkload;
  text.replace(text.find("workers: 3, "), 12, "");
  EXPECT_EQ(options_with({{"config", file_with(text)}}).workers, 0U);
}

TEST_F(OptionsTest, ResponsesAreCountedWhereBoundsArePossible) {
  const std::string file = file_with(kWorkload);
  EXPECT_GT(options_with({{"config", file}}).trace_capacity, 0U);
  EXPECT_EQ(options_with({{"config", file}, {"bounds", false}}).trace_capacity, 0U);
  std::string measured = kWorkload;
  measured.replace(measured.find("wcet: 1ms, "), 11, "");
  EXPECT_EQ(options_with({{"config", file_with(measured)}}).trace_capacity, 0U);

  const auto node = node_with({{"config", file}, {"bounds", false}});
  const ReDAGOptions options = declare_options(*node);
  EXPECT_TRUE(options.workload);
  EXPECT_FALSE(declare_monitor_options(*node, options).workload);
}

TEST_F(OptionsTest, MistakesSayWhichParameterWhatItIsAndWhatIsAllowed) {
  EXPECT_THAT(mistake_with({{"workers", -1}}), AllOf(HasSubstr("'workers'"), HasSubstr("-1"), HasSubstr("0 to 4096")));
  EXPECT_THAT(mistake_with({{"workers", "two"}}), AllOf(HasSubstr("'workers'"), HasSubstr("two"), HasSubstr("whole")));
  EXPECT_THAT(mistake_with({{"workers", 2.0}}), AllOf(HasSubstr("'workers'"), HasSubstr("2.0"), HasSubstr("whole")));
  EXPECT_THAT(mistake_with({{"preemption", "full"}}),
              AllOf(HasSubstr("'preemption'"), HasSubstr("full"), HasSubstr("auto, none, cooperative, os")));
  EXPECT_THAT(mistake_with({{"threads", 2}, {"workers", 4}}),
              AllOf(HasSubstr("'threads'"), HasSubstr("is 2"), HasSubstr("4 workers")));
  EXPECT_THAT(mistake_with({{"cpu_affinity", std::vector<std::int64_t>{100'000}}}),
              AllOf(HasSubstr("'cpu_affinity'"), HasSubstr("100000"), HasSubstr("may use (")));
  EXPECT_THAT(mistake_with({{"default_period", 0.0}}), AllOf(HasSubstr("'default_period'"), HasSubstr("above 0")));
  EXPECT_THAT(mistake_with({{"learn", -1.0}}), AllOf(HasSubstr("'learn'"), HasSubstr("-1")));
  EXPECT_THAT(mistake_with({{"learn", "long"}}), AllOf(HasSubstr("'learn'"), HasSubstr("long"), HasSubstr("seconds")));
  EXPECT_THAT(mistake_with({{"raise_middleware", 1}}),
              AllOf(HasSubstr("'raise_middleware'"), HasSubstr("true or false")));
  EXPECT_THAT(mistake_with({{"bounds", "yes"}}), AllOf(HasSubstr("'bounds'"), HasSubstr("true or false")));
  EXPECT_THAT(mistake_with({{"trace", 3}}), AllOf(HasSubstr("'trace'"), HasSubstr("folder")));
  EXPECT_THAT(mistake_with({{"trace_events", 0}}), AllOf(HasSubstr("'trace_events'"), HasSubstr("from 1")));
  EXPECT_THAT(mistake_with({{"metrics_period", std::numeric_limits<double>::quiet_NaN()}}),
              AllOf(HasSubstr("'metrics_period'"), HasSubstr("nan")));
}

TEST_F(OptionsTest, MistakesInTheWorkloadAreNamedByLine) {
  std::string text = kWorkload;
  text.replace(text.find("wcet"), 4, "wect");
  const std::string file = file_with(text);
  EXPECT_THAT(mistake_with({{"config", file}}),
              AllOf(HasSubstr("'config'"), HasSubstr(file + ":8:"), HasSubstr("wcet")));
  EXPECT_THAT(mistake_with({{"config", "/nowhere/robot.yaml"}}), AllOf(HasSubstr("'config'"), HasSubstr("/nowhere")));
}

// A random value of any type, mostly close to the allowed values or at their limits.
rclcpp::ParameterValue any_value(std::mt19937_64 &random, const std::string &workload) {
  const auto one_of = [&](const auto &values) { return values[random() % std::size(values)]; };
  static constexpr std::int64_t kIntegers[] = {0,
                                               1,
                                               2,
                                               5,
                                               -1,
                                               4096,
                                               4097,
                                               std::int64_t{1} << 32U,
                                               std::numeric_limits<std::int64_t>::min(),
                                               std::numeric_limits<std::int64_t>::max()};
  static constexpr double kNumbers[] = {0.0,
                                        -0.0,
                                        1e-9,
                                        1e-10,
                                        0.5,
                                        1e6,
                                        1.1e6,
                                        -1.0,
                                        1e308,
                                        5e-324,
                                        std::numeric_limits<double>::infinity(),
                                        std::numeric_limits<double>::quiet_NaN()};
  const std::string kTexts[] = {"",
                                "auto",
                                "os",
                                "none",
                                "edf",
                                "fifo",
                                "rate_monotonic",
                                "/",
                                "/dev/null",
                                "/dev/zero",
                                "\xff\xfe",
                                std::string(1, '\0'),
                                std::string(100'000, 'a'),
                                workload};
  switch (random() % 10) {
    case 0: return rclcpp::ParameterValue(random() % 2 == 0);
    case 1:
    case 2: return rclcpp::ParameterValue(one_of(kIntegers));
    case 3: return rclcpp::ParameterValue(one_of(kNumbers));
    case 4:
    case 5: return rclcpp::ParameterValue(one_of(kTexts));
    case 6: return rclcpp::ParameterValue(std::vector<std::int64_t>(random() % 3, one_of(kIntegers)));
    case 7: return rclcpp::ParameterValue(std::vector<double>(random() % 3, one_of(kNumbers)));
    case 8: return rclcpp::ParameterValue(std::vector<std::string>(random() % 3, one_of(kTexts)));
    default: return rclcpp::ParameterValue(std::vector<std::uint8_t>(random() % 3, 0xff));
  }
}

// REDAG_SEED chooses the values, REDAG_OPTION_ROUNDS the number of rounds.
TEST_F(OptionsTest, AnyValuesAreReadOrRefused) {
  const std::vector<std::string> names{"workers",      "preemption",     "threads",  "cpu_affinity",
                                       "config",       "default_period", "learn",    "raise_middleware",
                                       "live",         "metrics_period", "trace",    "bounds",
                                       "trace_events", "save_path",      "overheads"};
  const std::string workload = file_with(kWorkload);
  const std::uint64_t seed = from_environment("REDAG_SEED", 1);
  const std::uint64_t rounds = from_environment("REDAG_OPTION_ROUNDS", 400);
  // Keeps the middleware's participant alive, which ends with its last node. Creating one each time would take most of
  // the time.
  const auto stays = node_with({});
  std::mt19937_64 random(seed);
  std::uint64_t refused = 0;
  for (std::uint64_t round = 0; round < rounds; ++round) {
    std::map<std::string, rclcpp::ParameterValue> values;
    for (auto left = 1 + random() % 3; left > 0; --left) {
      values[names[random() % names.size()]] = any_value(random, workload);
    }
    std::vector<Parameter> overrides;
    std::string what = "REDAG_SEED=" + std::to_string(seed) + ", round " + std::to_string(round) + ":";
    for (const auto &[name, value] : values) {
      overrides.emplace_back(name, value);
      what += " " + name + "=" + rclcpp::to_string(value).substr(0, 100);
    }
    SCOPED_TRACE(what);
    // Without its publisher of parameter events, because Fast DDS cannot publish a text with a null character: it
    // throws, and crashes when the publisher is destroyed.
    const auto node = std::make_shared<rclcpp::Node>(
        "node", rclcpp::NodeOptions().parameter_overrides(overrides).start_parameter_event_publisher(false));
    try {
      const ReDAGOptions options = declare_options(*node);
      EXPECT_LE(options.workers, 4096U);
      EXPECT_TRUE(options.threads == 0 || options.threads >= options.workers);
      EXPECT_LE(options.threads, 4096U);
      EXPECT_GT(options.default_period, 0ns);
      EXPECT_GE(options.learn, 0ns);
      const std::vector<int> usable = redag::runtime::usable_cpus();
      EXPECT_THAT(options.cpus, ::testing::Each(::testing::AnyOfArray(usable)));
      const MonitorOptions monitor = declare_monitor_options(*node, options);
      EXPECT_GE(monitor.period, 0ns);
      EXPECT_GT(monitor.trace_events, 0U);
    } catch (const rclcpp::exceptions::InvalidParameterValueException &error) {
      ++refused;
      EXPECT_TRUE(std::any_of(values.begin(), values.end(), [&](const auto &value) {
        return std::string(error.what()).find("parameter '" + value.first + "' is ") != std::string::npos;
      })) << error.what();
    }
  }
  EXPECT_GT(refused, rounds / 4);
  EXPECT_LT(refused, rounds);
}

TEST_F(OptionsTest, ParametersSayWhatTheyAreAndStay) {
  const auto node = node_with({});
  const ReDAGOptions options = declare_options(*node);
  (void)declare_monitor_options(*node, options);
  for (const char *name :
       {"workers", "preemption", "threads", "cpu_affinity", "config", "default_period", "learn", "raise_middleware",
        "lock_memory", "watchdog", "metrics_period", "trace", "bounds", "trace_events", "save_path"}) {
    const auto descriptor = node->describe_parameter(name);
    EXPECT_FALSE(descriptor.description.empty()) << name;
    EXPECT_FALSE(descriptor.additional_constraints.empty()) << name;
    EXPECT_EQ(descriptor.read_only, std::string(name) != "save_path") << name;
  }
  EXPECT_FALSE(node->set_parameter({"workers", 2}).successful);
  EXPECT_TRUE(node->set_parameter({"save_path", "elsewhere.yaml"}).successful);
}

TEST_F(OptionsTest, ParametersThatAreThereAlreadyAreRead) {
  const auto node = std::make_shared<rclcpp::Node>("node", rclcpp::NodeOptions()
                                                               .parameter_overrides({{"workers", 2}})
                                                               .automatically_declare_parameters_from_overrides(true));
  EXPECT_EQ(declare_options(*node).workers, 2U);
  EXPECT_EQ(declare_options(*node).workers, 2U);
}

}  // namespace
}  // namespace redag_rclcpp
