// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A workload file's edges, executed: a callback's job begins once its message is there and all its predecessors have
// completed. Each run's trace passes the checker.
#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "mode_test.hpp"
#include "redag/runtime/blocking.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "spinning.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Runs of bodies, in the order of their beginnings.
class Runs {
 public:
  struct Run {
    std::string name;
    redag::Time begun = 0;
    redag::Time ended = 0;
  };

  /// A body that calls `inner` and notes when it ran.
  template <class Inner>
  std::function<void()> body(const std::string &name, Inner inner) {
    return [this, name, inner] {
      const std::size_t run = begin(name);
      inner();
      const std::lock_guard guard(lock_);
      runs_[run].ended = redag::runtime::monotonic_now();
    };
  }
  std::vector<Run> runs() const {
    const std::lock_guard guard(lock_);
    return runs_;
  }
  std::size_t count(const std::string &name) const {
    const std::vector<Run> all = runs();
    return static_cast<std::size_t>(
        std::count_if(all.begin(), all.end(), [&](const Run &run) { return run.name == name && run.ended != 0; }));
  }
  /// The n-th run of `name`.
  Run run(const std::string &name, std::size_t n = 0) const {
    for (const Run &run : runs()) {
      if (run.name == name && n-- == 0) return run;
    }
    ADD_FAILURE() << name << " did not run often enough";
    return {};
  }
  void clear() { runs_.clear(); }

 private:
  std::size_t begin(const std::string &name) {
    const std::lock_guard guard(lock_);
    runs_.push_back({name, redag::runtime::monotonic_now(), 0});
    return runs_.size() - 1;
  }

  mutable std::mutex lock_;
  std::vector<Run> runs_;
};

class PrecedenceTest : public ModeTest {
 protected:
  void SetUp() override {
    ModeTest::SetUp();
    if (IsSkipped()) return;
    options.workers = 2;
    options.trace_capacity = 1 << 16;
  }
  void TearDown() override {
    spinner.reset();
    executor.reset();
    ModeTest::TearDown();
  }

  void start(const std::string &workload) {
    options.workload = valid(workload);
    executor.emplace(options);
    executor->add_node(node);
    spinner = std::make_unique<Spinner<ReDAGExecutor>>(*executor);
  }
  /// Returns what the checker finds in the trace of the run.
  std::vector<std::string> stop() {
    spinner.reset();
    std::vector<redag::JobEvent> events;
    executor->drain_trace(events);
    const redag::trace::Trace trace = executor->as_trace(events);
    const redag::metrics::CheckReport report =
        redag::metrics::check_trace(trace, redag::metrics::rules_for(trace.info));
    std::vector<std::string> found;
    for (const redag::metrics::Violation &violation : report.violations) found.push_back(violation.text);
    return found;
  }
  std::uint64_t released(const std::string &task) const {
    for (const CallbackStats &stats : executor->stats()) {
      if (stats.task == task) return stats.jobs.released;
    }
    return 0;
  }
  /// Publishes, and returns once the message is there. Topics of this process are delivered at once.
  static void send(const rclcpp::Publisher<Empty>::SharedPtr &to) {
    ASSERT_TRUE(eventually([&] { return to->get_subscription_count() > 0; }));
    to->publish(Empty());
  }

  Runs runs;
  std::optional<ReDAGExecutor> executor;
  std::unique_ptr<Spinner<ReDAGExecutor>> spinner;
};

constexpr const char *kChain = R"(
name: chain
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 100ms, callback: {node: /node, subscription: /start}}
      - {name: fusion, after: camera, callback: {node: /node, subscription: /camera}}
)";

TEST_P(PrecedenceTest, AMessageWaitsForTheEndOfItsPublisher) {
  const auto out = publisher("camera");
  const auto camera = subscribe("start", runs.body("camera", [&] {
    out->publish(Empty());
    use_processor(5ms);
  }));
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto trigger = publisher("start");
  start(kChain);
  for (std::size_t n = 1; n <= 20; ++n) {
    send(trigger);
    ASSERT_TRUE(eventually([&] { return runs.count("fusion") == n; }));
    EXPECT_GE(runs.run("fusion", n - 1).begun, runs.run("camera", n - 1).ended);
  }
  EXPECT_THAT(stop(), IsEmpty());
}

// The job's release is the end of the last predecessor, not the arrival of the message: responses are those of the
// model.
TEST_P(PrecedenceTest, TheResponseBeginsWithTheLastPredecessor) {
  const auto out = publisher("camera");
  const auto camera = subscribe("start", [&] {
    out->publish(Empty());
    use_processor(30ms);
  });
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto trigger = publisher("start");
  start(kChain);
  send(trigger);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 1; }));
  spinner.reset();
  std::vector<redag::JobEvent> events;
  executor->drain_trace(events);
  std::map<std::string, redag::Time> ends;
  std::map<std::string, redag::Time> releases;
  for (const redag::JobEvent &event : events) {
    const std::string task = executor->task_name(event.task);
    if (event.kind == redag::JobEventKind::Finished) ends[task] = event.value;
    if (event.kind == redag::JobEventKind::Released) releases[task] = event.value;
  }
  EXPECT_EQ(releases.at("d.fusion"), ends.at("d.camera"));
}

TEST_P(PrecedenceTest, AJoinWaitsForAllItsPredecessors) {
  std::atomic<bool> lidar_may_end{false};
  const auto to_fusion = publisher("camera");
  const auto camera = subscribe("start_camera", runs.body("camera", [&] { to_fusion->publish(Empty()); }));
  const auto lidar = subscribe("start_lidar", runs.body("lidar", [&] {
    const redag::Blocking blocking;
    while (!lidar_may_end) std::this_thread::sleep_for(1ms);
  }));
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  options.threads = 4;
  const auto start_camera = publisher("start_camera");
  const auto start_lidar = publisher("start_lidar");
  start(R"(
name: join
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 100ms, callback: {node: /node, subscription: /start_camera}}
      - {name: lidar, period: 100ms, callback: {node: /node, subscription: /start_lidar}}
      - {name: fusion, after: [camera, lidar], callback: {node: /node, subscription: /camera}}
)");
  send(start_camera);
  send(start_lidar);
  ASSERT_TRUE(eventually([&] { return runs.count("camera") == 1 && runs.runs().size() == 2; }));
  EXPECT_EQ(released("d.fusion"), 0U);
  // A newer message replaces the one that waits.
  send(start_camera);
  ASSERT_TRUE(eventually([&] { return runs.count("camera") == 2; }));
  EXPECT_EQ(released("d.fusion"), 0U);
  lidar_may_end = true;
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 1; }));
  EXPECT_GE(runs.run("fusion").begun, runs.run("lidar").ended);
  send(start_lidar);  // without a message of the camera
  ASSERT_TRUE(eventually([&] { return runs.count("lidar") == 2; }));
  send(start_camera);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 2; }));
  EXPECT_EQ(released("d.fusion"), 2U);
  EXPECT_THAT(stop(), IsEmpty());
}

// A job that throws has no output. The message that it sent waits for the next one.
TEST_P(PrecedenceTest, AnAbortedPredecessorReleasesNothing) {
  options.on_exception = [](const ExceptionInfo &) { return OnException::Continue; };
  std::atomic<bool> fails{true};
  const auto out = publisher("camera");
  const auto camera = subscribe("start", [&] {
    out->publish(Empty());
    const auto ended = runs.body("camera", [] {});
    ended();
    if (fails) throw std::runtime_error("no image");
  });
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto trigger = publisher("start");
  start(kChain);
  send(trigger);
  ASSERT_TRUE(eventually([&] {
    const std::vector<CallbackStats> stats = executor->stats();
    return std::any_of(stats.begin(), stats.end(),
                       [](const CallbackStats &s) { return s.task == "d.camera" && s.jobs.aborted == 1; });
  }));
  EXPECT_EQ(released("d.fusion"), 0U);
  fails = false;
  send(trigger);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 1; }));
  EXPECT_EQ(released("d.fusion"), 1U);
  EXPECT_THAT(stop(), IsEmpty());
}

// The predecessor sends nothing in one job: later messages still wait for their own sender.
TEST_P(PrecedenceTest, AfterALostMessageTheNextWaitsForItsOwnSender) {
  std::atomic<int> job{0};
  const auto out = publisher("camera");
  const auto camera = subscribe("start", runs.body("camera", [&] {
    if (++job != 1) out->publish(Empty());
    use_processor(3ms);
  }));
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto trigger = publisher("start");
  start(kChain);
  for (std::size_t n = 1; n <= 4; ++n) {
    send(trigger);
    ASSERT_TRUE(eventually([&] { return runs.count("camera") == n && runs.count("fusion") == n - 1; }));
    if (n > 1) EXPECT_GE(runs.run("fusion", n - 2).begun, runs.run("camera", n - 1).ended);
  }
  EXPECT_THAT(stop(), IsEmpty());
}

// A message of another process, or of a thread, has no sender here.
TEST_P(PrecedenceTest, AMessageFromOutsideWaitsForTheNextEndOfThePredecessor) {
  const auto camera = subscribe("start", runs.body("camera", [] {}));
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto trigger = publisher("start");
  const auto outside = publisher("camera");
  start(kChain);
  send(outside);
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(runs.count("fusion"), 0U);
  send(trigger);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 1; }));
  EXPECT_THAT(stop(), IsEmpty());
}

// Edges hold between callbacks that are present. A node that comes later brings its edges, and takes them with it.
TEST_P(PrecedenceTest, EdgesComeAndGoWithTheirNodes) {
  const auto camera_out = publisher("camera");
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  start(R"(
name: nodes
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 100ms, callback: {node: /late, subscription: /start}}
      - {name: fusion, after: camera, callback: {node: /node, subscription: /camera}}
)");
  send(camera_out);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 1; }))
      << "it does not wait for a callback that is absent";

  auto late = std::make_shared<rclcpp::Node>("late", rclcpp::NodeOptions().use_intra_process_comms(true));
  const auto camera = late->create_subscription<Empty>(
      "start", rclcpp::QoS(10), [body = runs.body("camera", [] {})](Empty::ConstSharedPtr) { body(); });
  executor->add_node(late);
  const auto trigger = publisher("start");
  send(camera_out);
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(runs.count("fusion"), 1U);
  send(trigger);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 2; }));

  executor->remove_node(late);
  send(camera_out);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 3; }));
  EXPECT_THAT(stop(), IsEmpty());
}

// A recorder or rviz makes the publisher send through the middleware as well, which brings each message a second time.
TEST_P(PrecedenceTest, AListenerFromOutsideTakesNothingFromAChain) {
  const auto outside = std::make_shared<rclcpp::Node>("outside");
  const auto recorder = outside->create_subscription<Empty>("camera", rclcpp::QoS(10), [](Empty::ConstSharedPtr) {});
  const auto out = publisher("camera");
  const auto camera = subscribe("start", runs.body("camera", [&] { out->publish(Empty()); }));
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto trigger = publisher("start");
  start(kChain);
  ASSERT_TRUE(eventually([&] { return out->get_subscription_count() == 2; }));
  for (std::size_t n = 1; n <= 20; ++n) {
    send(trigger);
    ASSERT_TRUE(eventually([&] { return runs.count("fusion") == n; }));
    EXPECT_GE(runs.run("fusion", n - 1).begun, runs.run("camera", n - 1).ended);
  }
  EXPECT_THAT(stop(), IsEmpty());
}

// It came before the executor had the node. The hook reports it, and the wait set finds it as well.
TEST_P(PrecedenceTest, AMessageFromBeforeCostsNoLaterOne) {
  const auto latched = rclcpp::QoS(1).transient_local();
  const rclcpp::NodeOptions no_intra_process = rclcpp::NodeOptions().use_intra_process_comms(false);
  const auto other = std::make_shared<rclcpp::Node>("other", no_intra_process);
  const auto out = other->create_publisher<Empty>("camera", latched);
  out->publish(Empty());
  const auto fusion = other->create_subscription<Empty>(
      "camera", latched, [body = runs.body("fusion", [] {})](Empty::ConstSharedPtr) { body(); });
  const auto camera = subscribe("start", runs.body("camera", [&] { out->publish(Empty()); }));
  const auto trigger = publisher("start");
  std::this_thread::sleep_for(50ms);
  options.workload = valid(R"(
name: latched
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 100ms, callback: {node: /node, subscription: /start}}
      - {name: fusion, after: camera, callback: {node: /other, subscription: /camera}}
)");
  executor.emplace(options);
  executor->add_node(node);
  executor->add_node(other);
  spinner = std::make_unique<Spinner<ReDAGExecutor>>(*executor);
  for (std::size_t n = 1; n <= 5; ++n) {
    send(trigger);
    ASSERT_TRUE(eventually([&] { return runs.count("fusion") == n; })) << n;
  }
  EXPECT_THAT(stop(), IsEmpty());
}

// Which of its callbacks would be the one to wait for? One of them may have a lower rate, or none.
TEST_P(PrecedenceTest, ATaskOfSeveralCallbacksIsNotWaitedFor) {
  const auto out = publisher("camera");
  const auto frames = node->create_wall_timer(10ms, [&] { out->publish(Empty()); });
  const auto diagnostics = node->create_wall_timer(1h, [] {});
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  start(R"(
name: any
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 10ms, callback: {node: /node, timer: any}}
      - {name: fusion, after: camera, callback: {node: /node, subscription: /camera}}
)");
  EXPECT_TRUE(eventually([&] { return runs.count("fusion") >= 5; }));
  EXPECT_THAT(executor->warnings(), Contains(HasSubstr("d.fusion does not wait for d.camera, which is 2 callbacks")));
  EXPECT_THAT(stop(), IsEmpty());
}

TEST_P(PrecedenceTest, APredecessorThatDoesNotRunIsNamedAndADestroyedOneIsForgotten) {
  auto camera = node->create_wall_timer(
      10ms, [] {}, new_group());
  const auto fusion = subscribe("lidar", runs.body("fusion", [] {}));
  const auto lidar = publisher("lidar");
  camera->cancel();
  start(R"(
name: silent
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 10ms, callback: {node: /node, timer: 10ms}}
      - {name: fusion, after: camera, callback: {node: /node, subscription: /lidar}}
)");
  send(lidar);
  const auto is_named = [&] {
    const std::vector<std::string> all = executor->warnings();
    return std::any_of(all.begin(), all.end(), [](const std::string &warning) {
      return warning.find("d.fusion has a message, and waits for the end of d.camera") != std::string::npos;
    });
  };
  EXPECT_TRUE(eventually(is_named));
  EXPECT_EQ(runs.count("fusion"), 0U);
  camera.reset();
  EXPECT_TRUE(eventually([&] { return runs.count("fusion") == 1; }));
  EXPECT_THAT(stop(), IsEmpty());
}

TEST_P(PrecedenceTest, ATimerWaitsForFreshData) {
  const auto camera = subscribe("start", runs.body("camera", [] {}));
  const auto control = node->create_wall_timer(5ms, runs.body("control", [] {}), new_group());
  const auto trigger = publisher("start");
  start(R"(
name: timer
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 100ms, callback: {node: /node, subscription: /start}}
      - {name: control, after: camera, callback: {node: /node, timer: 5ms}}
)");
  std::this_thread::sleep_for(30ms);
  EXPECT_EQ(runs.count("control"), 0U);
  for (std::size_t n = 1; n <= 3; ++n) {
    send(trigger);
    ASSERT_TRUE(eventually([&] { return runs.count("control") == n; }));
  }
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(runs.count("control"), 3U);
  EXPECT_THAT(stop(), IsEmpty());
}

/// A timer whose call comes late, as if the system had taken the processor from its thread.
class LateTimer : public rclcpp::WallTimer<std::function<void()>> {
 public:
  using WallTimer::WallTimer;
  auto call() -> decltype(std::declval<rclcpp::TimerBase &>().call()) override {
    std::this_thread::sleep_for(25ms);
    return WallTimer::call();
  }
};

// A call consumes all expiries that have passed. The last of them may have released the next job by then.
TEST_P(PrecedenceTest, ATimerThatIsCalledLateRunsForEachJobOfItsPredecessor) {
  constexpr std::size_t kRounds = 5;
  const auto trigger = publisher("start");
  const auto camera = subscribe("start", runs.body("camera", [] {}));
  std::function<void()> control = runs.body("control", [&] {
    if (runs.count("camera") < kRounds) trigger->publish(Empty());
  });
  const auto timer =
      std::make_shared<LateTimer>(20ms, std::move(control), node->get_node_base_interface()->get_context());
  node->get_node_timers_interface()->add_timer(timer, new_group());
  start(R"(
name: late
platform: {workers: 2}
dags:
  - name: d
    tasks:
      - {name: camera, period: 100ms, callback: {node: /node, subscription: /start}}
      - {name: control, after: camera, callback: {node: /node, timer: 20ms}}
)");
  send(trigger);
  EXPECT_TRUE(eventually([&] { return runs.count("control") == kRounds; })) << runs.count("control");
  EXPECT_THAT(stop(), IsEmpty());
}

TEST_P(PrecedenceTest, EdgesThatWereOnlySeenAreNotExecuted) {
  const auto fusion = subscribe("camera", runs.body("fusion", [] {}));
  const auto camera = subscribe("start", runs.body("camera", [] {}));
  const auto outside = publisher("camera");
  std::string seen = kChain;
  seen.replace(seen.find("name: d"), 7, "name: d\n    edges: seen");
  start(seen);
  send(outside);
  ASSERT_TRUE(eventually([&] { return runs.count("fusion") == 1; }));
  EXPECT_THAT(stop(), IsEmpty());
}

// ---- random DAGs ----

/// A random DAG whose first task is released from outside. Every other task follows one to three earlier ones, and gets
/// its message from the last of them.
redag::Workload random_dag(std::mt19937 &random) {
  const auto below = [&](std::size_t n) { return static_cast<std::uint32_t>(random() % n); };
  redag::Workload workload;
  workload.name = "random";
  workload.platform.workers = 1;
  redag::Dag &dag = workload.dags.emplace_back();
  dag.name = "d";
  const std::size_t size = 2 + below(7);
  for (std::size_t t = 0; t < size; ++t) {
    redag::Task &task = dag.tasks.emplace_back();
    task.name = fmt::format("t{}", t);
    task.wcet = task.bcet = redag::kMicrosecond;
    task.period = task.deadline = redag::kSecond;
    task.callback = redag::Callback{.node = "/node", .kind = redag::Callback::Kind::Subscription, .name = "/start"};
    if (t == 0) continue;
    for (std::size_t n = 1 + below(3); n > 0; --n) {
      const std::uint32_t p = below(t);
      if (std::find(task.predecessors.begin(), task.predecessors.end(), p) == task.predecessors.end())
        task.predecessors.push_back(p);
    }
    std::sort(task.predecessors.begin(), task.predecessors.end());
    task.activation = redag::Activation::Data;
    task.callback->name = fmt::format("/t{}", task.predecessors.back());
  }
  return workload;
}

/// The order in which the simulator begins the tasks' first jobs.
std::vector<std::string> simulated_order(const redag::Workload &workload) {
  std::vector<std::string> order;
  const auto scheduler = redag::executors::make_scheduler("redag", workload, redag::sched::config_of(workload));
  const redag::sim::EventSink sink = [&](std::span<const redag::JobEvent> events) {
    for (const redag::JobEvent &event : events) {
      if (event.kind == redag::JobEventKind::Dispatched) order.push_back(workload.dags[0].tasks[event.task.value].name);
    }
    return true;
  };
  redag::sim::simulate(workload, *scheduler, 1, redag::sim::Options{}, sink);
  return order;
}

// With one worker, callbacks run in exactly the simulator's order. Tasks that take their messages from one topic are
// told apart by their nodes, so each task has a node of its own.
TEST_P(PrecedenceTest, RandomDAGsRunInTheSimulatorsOrder) {
  constexpr int kDAGs = 350;  // in each of three modes
  std::mt19937 random(20'261'128);
  options.workers = 1;
  for (int d = 0; d < kDAGs; ++d) {
    SCOPED_TRACE(fmt::format("DAG {}", d));
    const bool intra_process = d % 2 == 0;
    redag::Workload workload = random_dag(random);
    std::vector<rclcpp::Node::SharedPtr> nodes;
    std::vector<rclcpp::Publisher<Empty>::SharedPtr> publishers;
    std::vector<rclcpp::Subscription<Empty>::SharedPtr> subscriptions;
    runs.clear();
    const rclcpp::NodeOptions node_options = rclcpp::NodeOptions()
                                                 .use_intra_process_comms(intra_process)
                                                 .start_parameter_services(false)
                                                 .start_parameter_event_publisher(false)
                                                 .enable_rosout(false)
                                                 .append_parameter_override("start_type_description_service", false);
    for (redag::Task &task : workload.dags[0].tasks) {
      task.callback->node = fmt::format("/d{}/{}", d, task.name);
      task.callback->name = fmt::format("/d{}{}", d, task.callback->name);
      nodes.push_back(std::make_shared<rclcpp::Node>(task.name, fmt::format("d{}", d), node_options));
      publishers.push_back(nodes.back()->create_publisher<Empty>(task.name, rclcpp::QoS(1)));
      const auto body = runs.body(task.name, [out = publishers.back()] { out->publish(Empty()); });
      subscriptions.push_back(nodes.back()->create_subscription<Empty>(task.callback->name, rclcpp::QoS(1),
                                                                       [body](Empty::ConstSharedPtr) { body(); }));
    }
    const auto trigger = nodes[0]->create_publisher<Empty>("start", rclcpp::QoS(1));
    // One more reader of each topic, as a recorder is: each message then comes twice.
    const bool is_recorded = d % 4 == 0;
    const auto recorder = std::make_shared<rclcpp::Node>(
        "recorder", fmt::format("d{}", d), rclcpp::NodeOptions(node_options).use_intra_process_comms(false));
    for (std::size_t t = 0; is_recorded && t < nodes.size(); ++t) {
      subscriptions.push_back(
          recorder->create_subscription<Empty>(fmt::format("t{}", t), rclcpp::QoS(1), [](Empty::ConstSharedPtr) {}));
    }
    for (std::size_t t = 0; t < nodes.size(); ++t) {
      const auto &tasks = workload.dags[0].tasks;
      const auto readers =
          std::count_if(tasks.begin(), tasks.end(),
                        [&](const redag::Task &task) { return task.callback->name == fmt::format("/d{}/t{}", d, t); }) +
          (is_recorded ? 1 : 0);
      ASSERT_TRUE(
          eventually([&] { return publishers[t]->get_subscription_count() == static_cast<std::size_t>(readers); }));
    }
    options.workload = redag::validated(workload).value();
    executor.emplace(options);
    for (const auto &one : nodes) executor->add_node(one);
    spinner = std::make_unique<Spinner<ReDAGExecutor>>(*executor);
    send(trigger);
    const auto all_ended = [&] {
      const std::vector<Runs::Run> all = runs.runs();
      return all.size() >= nodes.size() && all.back().ended != 0;
    };
    ASSERT_TRUE(eventually(all_ended)) << to_yaml(workload);
    EXPECT_THAT(stop(), IsEmpty()) << to_yaml(workload);
    std::vector<std::string> order;
    for (const Runs::Run &run : runs.runs()) order.push_back(run.name);
    ASSERT_EQ(order, simulated_order(workload)) << to_yaml(workload);
    executor.reset();
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, PrecedenceTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(redag::to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
