// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares the latency and cost of executors: ReDAGExecutor in each preemption mode, and its peers
// (peers.hpp). The executors take turns in one process, round by round. Prints medians over the rounds, and in brackets
// the least and the most of them.
//
//   ros2 run redag_rclcpp_lab bench_executors --help
#include <malloc.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "contenders.hpp"
#include "phased_timer.hpp"
#include "rclcpp/rclcpp.hpp"
#include "ring.hpp"
#include "samples.hpp"
#include "std_msgs/msg/u_int64.hpp"

namespace {

using namespace std::chrono_literals;
using redag_rclcpp::lab::Contender;
using redag_rclcpp::lab::contenders;
using redag_rclcpp::lab::median;
using redag_rclcpp::lab::Samples;
using Message = std_msgs::msg::UInt64;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

std::int64_t now_ns() { return steady_clock::now().time_since_epoch().count(); }

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Context switches of the process.
double switches() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_nvcsw + usage.ru_nivcsw);
}

double resident_mb() {
  malloc_trim(0);
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages >> pages;
  return static_cast<double>(pages) * static_cast<double>(getpagesize()) / 1e6;
}

double us(const Samples &samples, double share) { return samples.milliseconds(share) * 1e3; }

using Figures = std::map<std::string, double>;

class Spinning {
 public:
  explicit Spinning(rclcpp::Executor &executor) : executor_(executor), thread_([&] { executor.spin(); }) {
    // Waits at most 50 ms: EventsCBGExecutor has a flag of its own, which this function does not see.
    for (int i = 0; i < 500 && !executor.is_spinning(); ++i) std::this_thread::sleep_for(100us);
    std::this_thread::sleep_for(50ms);
  }
  ~Spinning() {
    executor_.cancel();
    thread_.join();
  }

 private:
  rclcpp::Executor &executor_;
  std::thread thread_;
};

void burn(nanoseconds time) {
  const auto end = steady_clock::now() + time;
  while (steady_clock::now() < end) {
  }
}

// Lateness of a timer against its grid. With `load`, a callback of another group computes for that long, which is 60 %
// of its period.
Figures timer_lateness(rclcpp::Executor &executor, double seconds, nanoseconds period, nanoseconds load) {
  auto node = std::make_shared<rclcpp::Node>("bench");
  auto fast = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  auto slow = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  const redag::Time first = redag_rclcpp::lab::timer_clock_now() + nanoseconds(200ms).count();
  Samples lateness;
  std::int64_t last_point = -1;
  redag_rclcpp::lab::PhasedTimer timer(*node, fast, first, period.count(), [&](std::int64_t point) {
    lateness.add(redag_rclcpp::lab::timer_clock_now() - first - point * period.count());
    last_point = point;
  });
  std::optional<redag_rclcpp::lab::PhasedTimer> background;
  if (load > 0ns) {
    background.emplace(*node, slow, first, load.count() / 6 * 10, [load](std::int64_t) { burn(load); });
  }
  executor.add_node(node);
  double used = 0;
  {
    Spinning spinning(executor);
    const double before = cpu_seconds();
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    used = cpu_seconds() - before;
  }
  executor.remove_node(node);
  const auto called = static_cast<double>(lateness.size());
  Figures figures{{"p50_us", us(lateness, 0.5)},
                  {"p99_us", us(lateness, 0.99)},
                  {"lost_%", 100.0 * (1.0 - called / static_cast<double>(last_point + 1))}};
  if (load == 0ns) figures["cpu_s_per_10k"] = used / called * 1e4;
  return figures;
}

// Latency from publish() to the start of the callback, at 500 Hz.
Figures publish_latency(rclcpp::Executor &executor, double seconds, bool intra_process) {
  auto node = std::make_shared<rclcpp::Node>("bench", rclcpp::NodeOptions().use_intra_process_comms(intra_process));
  Samples latency;
  auto subscription = node->create_subscription<Message>("latency", rclcpp::QoS(10), [&](Message::UniquePtr message) {
    latency.add(now_ns() - static_cast<std::int64_t>(message->data));
  });
  auto publisher = node->create_publisher<Message>("latency", rclcpp::QoS(10));
  executor.add_node(node);
  {
    Spinning spinning(executor);
    const int count = static_cast<int>(seconds * 500);
    for (int i = 0; i < count; ++i) {
      auto message = std::make_unique<Message>();
      message->data = static_cast<std::uint64_t>(now_ns());
      publisher->publish(std::move(message));
      std::this_thread::sleep_for(2ms);
    }
    std::this_thread::sleep_for(50ms);
  }
  executor.remove_node(node);
  return {{"p50_us", us(latency, 0.5)}, {"p99_us", us(latency, 0.99)}};
}

// Time from spin() to the callback for a message that was there before, and from cancel() to the end of spin().
Figures start_and_stop(rclcpp::Executor &executor) {
  auto node = std::make_shared<rclcpp::Node>("bench");
  std::atomic<std::int64_t> called{0};
  auto subscription = node->create_subscription<Message>("start", rclcpp::QoS(10), [&](const Message &) {
    called = now_ns();
    called.notify_one();
  });
  auto publisher = node->create_publisher<Message>("start", rclcpp::QoS(10));
  executor.add_node(node);
  publisher->publish(Message());
  std::this_thread::sleep_for(20ms);
  std::int64_t began = 0;
  std::int64_t ended = 0;
  std::thread spinning([&] {
    began = now_ns();
    executor.spin();
    ended = now_ns();
  });
  called.wait(0);
  std::this_thread::sleep_for(20ms);
  const std::int64_t cancelled = now_ns();
  executor.cancel();
  spinning.join();
  executor.remove_node(node);
  return {{"start_ms", static_cast<double>(called - began) / 1e6},
          {"stop_ms", static_cast<double>(ended - cancelled) / 1e6}};
}

// Callbacks in a second while a ring of `count` subscriptions keeps the executor busy, and how often its threads left
// their processors for a callback.
Figures saturation(rclcpp::Executor &executor, double seconds, std::size_t count, bool middleware) {
  std::atomic<std::uint64_t> calls{0};
  std::atomic<bool> stop{false};
  const auto go_on = [&] {
    calls.fetch_add(1, std::memory_order_relaxed);
    return !stop;
  };
  redag_rclcpp::lab::Ring ring(count, go_on, middleware);
  executor.add_node(ring.node());
  Figures figures;
  {
    Spinning spinning(executor);
    ring.publish();
    std::this_thread::sleep_for(20ms);
    const std::uint64_t calls_before = calls;
    const double cpu_before = cpu_seconds();
    const double switches_before = switches();
    const auto start = steady_clock::now();
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    const double elapsed = std::chrono::duration<double>(steady_clock::now() - start).count();
    const auto done = static_cast<double>(calls - calls_before);
    figures["kcalls_per_s"] = done / elapsed / 1e3;
    figures["cpu_s_per_10k"] = (cpu_seconds() - cpu_before) / done * 1e4;
    figures["switches"] = (switches() - switches_before) / done;
    stop = true;
    std::this_thread::sleep_for(20ms);
  }
  executor.remove_node(ring.node());
  return figures;
}

// Messages of 200 and 50 Hz from the executor's first moment on, beside two timers that compute for 60 of every 100 ms.
// A new executor knows no rate but those of the timers. Late: more than a period behind. Lost: overwritten, too.
Figures first_messages(rclcpp::Executor &executor, double seconds) {
  struct Topic {
    nanoseconds period;
    int sent = 0;
    int in_time = 0;
    rclcpp::Publisher<Message>::SharedPtr publisher{};
    rclcpp::Subscription<Message>::SharedPtr subscription{};
  };
  auto node = std::make_shared<rclcpp::Node>("bench");
  rclcpp::SubscriptionOptions own_group;
  std::array topics{Topic{5ms}, Topic{20ms}};
  std::vector<std::shared_ptr<void>> kept;
  const auto new_group = [&] {
    const auto group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
    kept.push_back(group);
    return group;
  };
  for (Topic &topic : topics) {
    const std::string name = "first_" + std::to_string(topic.period.count());
    own_group.callback_group = new_group();
    topic.publisher = node->create_publisher<Message>(name, rclcpp::QoS(10));
    topic.subscription = node->create_subscription<Message>(
        name, rclcpp::QoS(10),
        [&topic](Message::UniquePtr message) {
          burn(200us);
          if (now_ns() - static_cast<std::int64_t>(message->data) <= topic.period.count()) ++topic.in_time;
        },
        own_group);
  }
  for (int i = 0; i < 2; ++i)
    kept.push_back(node->create_wall_timer(
        100ms, [] { burn(60ms); }, new_group()));
  executor.add_node(node);
  {
    std::thread spinning([&] { executor.spin(); });
    const auto begin = steady_clock::now();
    for (int i = 1; i <= static_cast<int>(seconds * 200); ++i) {
      std::this_thread::sleep_until(begin + i * 5ms);
      for (Topic &topic : topics) {
        if (i * 5ms % topic.period != 0ns) continue;
        Message message;
        message.data = static_cast<std::uint64_t>(now_ns());
        topic.publisher->publish(message);
        ++topic.sent;
      }
    }
    std::this_thread::sleep_for(100ms);
    executor.cancel();
    spinning.join();
  }
  executor.remove_node(node);
  Figures figures;
  for (const Topic &topic : topics) {
    const auto in_time = static_cast<double>(topic.in_time);
    figures["late_%_" + std::to_string(1s / topic.period) + "hz"] = 100.0 * (1.0 - in_time / topic.sent);
  }
  return figures;
}

// What 4,800 callbacks of 200 nodes cost: each node has 12 groups of a timer and a subscription. Executors can look at
// new nodes later: nodes are added, or removed, once a message reaches the last one.
Figures many_callbacks(rclcpp::Executor &executor, double seconds) {
  std::vector<rclcpp::Node::SharedPtr> nodes;
  std::vector<std::shared_ptr<void>> kept;
  std::atomic<int> reached{0};
  for (int n = 0; n < 200; ++n) {
    const auto node = nodes.emplace_back(std::make_shared<rclcpp::Node>("bench" + std::to_string(n)));
    for (int i = 0; i < 12; ++i) {
      rclcpp::SubscriptionOptions own_group;
      own_group.callback_group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
      kept.push_back(own_group.callback_group);
      kept.push_back(node->create_wall_timer(
          500ms + i * 10ms, [] {}, own_group.callback_group));
      const auto called = [&](const Message &) { reached.fetch_add(1), reached.notify_one(); };
      const std::string topic = "bench" + std::to_string(n) + "_" + std::to_string(i);
      kept.push_back(node->create_subscription<Message>(topic, rclcpp::QoS(10), called, own_group));
    }
  }
  const auto publisher = nodes.back()->create_publisher<Message>("bench199_11", rclcpp::QoS(10));
  Figures figures;
  {
    Spinning spinning(executor);
    const double memory = resident_mb();
    double before = cpu_seconds();
    const auto used = [&] { return cpu_seconds() - std::exchange(before, cpu_seconds()); };
    auto reach = [&, wanted = 0]() mutable {
      publisher->publish(Message());
      reached.wait(wanted++);
      return used();
    };
    for (const auto &node : nodes) executor.add_node(node);
    figures["add_cpu_s"] = reach();
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    figures["used_%"] = used() / seconds * 100;
    figures["memory_mb"] = resident_mb() - memory;
    for (std::size_t n = 0; n + 1 < nodes.size(); ++n) executor.remove_node(nodes[n]);
    figures["remove_cpu_s"] = reach();
  }
  executor.remove_node(nodes.back());
  return figures;
}

// The publishing process of arrivals_loaded: 100 Hz, above all threads it competes with.
int publish_for(double seconds) {
  sched_param priority{95};
  sched_setscheduler(0, SCHED_FIFO, &priority);  // if this is refused, it is as late as all others
  rclcpp::init(0, nullptr);
  auto node = std::make_shared<rclcpp::Node>("publishing");
  auto publisher = node->create_publisher<Message>("arrivals", rclcpp::QoS(10));
  const auto end = steady_clock::now() + std::chrono::duration<double>(seconds);
  while (steady_clock::now() < end) {
    Message message;
    message.data = static_cast<std::uint64_t>(now_ns());
    publisher->publish(message);
    std::this_thread::sleep_for(10ms);
  }
  rclcpp::shutdown();
  return 0;
}

// Latency from publish() in another process to the start of the callback. Callbacks of lower rate meanwhile compute 90
// % of the time on each of two processors.
Figures arrivals_loaded(rclcpp::Executor &executor, double seconds) {
  const pid_t child = fork();
  if (child == 0) {
    const std::string duration = std::to_string(seconds + 1.5);
    execl("/proc/self/exe", "bench_executors", "--publish", duration.c_str(), nullptr);
    _exit(2);
  }
  auto node = std::make_shared<rclcpp::Node>("bench");
  Samples latency;
  rclcpp::SubscriptionOptions own_group;
  own_group.callback_group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  auto subscription = node->create_subscription<Message>(
      "arrivals", rclcpp::QoS(10),
      [&](Message::UniquePtr message) { latency.add(now_ns() - static_cast<std::int64_t>(message->data)); }, own_group);
  std::vector<rclcpp::TimerBase::SharedPtr> loads;
  std::vector<rclcpp::CallbackGroup::SharedPtr> groups;
  for (int i = 0; i < 2; ++i) {
    groups.push_back(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
    loads.push_back(node->create_wall_timer(
        200ms, [] { burn(180ms); }, groups.back()));
  }
  executor.add_node(node);
  {
    Spinning spinning(executor);
    std::this_thread::sleep_for(1s);  // time for discovery
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  }
  executor.remove_node(node);
  waitpid(child, nullptr, 0);
  const auto received = static_cast<double>(latency.size());
  return {{"p50_us", us(latency, 0.5)}, {"p99_us", us(latency, 0.99)}, {"received", received}};
}

struct Measurement {
  std::string name;
  std::function<Figures(rclcpp::Executor &, double)> run;
};

std::vector<Measurement> measurements() {
  return {
      {"start_and_stop", [](auto &e, double) { return start_and_stop(e); }},
      {"timer_idle", [](auto &e, double s) { return timer_lateness(e, s, 10ms, 0ms); }},
      {"timer_loaded", [](auto &e, double s) { return timer_lateness(e, s, 10ms, 60ms); }},
      {"timer_1khz_loaded", [](auto &e, double s) { return timer_lateness(e, s, 1ms, 6ms); }},
      {"intra_process", [](auto &e, double s) { return publish_latency(e, s, true); }},
      {"dds", [](auto &e, double s) { return publish_latency(e, s, false); }},
      {"arrivals_loaded", [](auto &e, double s) { return arrivals_loaded(e, s); }},
      {"first_messages", [](auto &e, double s) { return first_messages(e, s); }},
      {"saturation_1", [](auto &e, double s) { return saturation(e, s, 1, false); }},
      {"saturation_50", [](auto &e, double s) { return saturation(e, s, 50, false); }},
      {"saturation_50_dds", [](auto &e, double s) { return saturation(e, s, 50, true); }},
      {"many_callbacks", [](auto &e, double s) { return many_callbacks(e, s); }},
  };
}

using Names = std::vector<std::string>;

bool is_listed(const std::string &name, const Names &names) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

int main(int argc, char **argv) {
  if (argc == 3 && std::string(argv[1]) == "--publish") return publish_for(std::atof(argv[2]));
  int rounds = 5;
  double seconds = 1;
  std::uint32_t workers = 2;
  Names only;
  Names executors;
  CLI::App app("Compares the latency and cost of executors, which take turns", "bench_executors");
  Names names;
  for (const Measurement &measurement : measurements()) names.push_back(measurement.name);
  redag_rclcpp::lab::add_number(app, "--rounds", rounds, 1, "Rounds, of which the medians are printed");
  redag_rclcpp::lab::add_number(app, "--seconds", seconds, 0.1, "Length of a measurement");
  redag_rclcpp::lab::add_number(app, "--workers", workers, 1U, "Threads of each executor");
  redag_rclcpp::lab::add_list(app, "--only", only, "These measurements; a wrong name lists all")
      ->check(CLI::IsMember(names).description(""));
  redag_rclcpp::lab::add_list(app, "--executors", executors, "These executors, such as mte,redag-none");
  if (const auto status = redag_rclcpp::lab::parse_arguments(app, argc, argv)) return *status;
  rclcpp::init(0, nullptr);
  rclcpp::get_logger("redag_rclcpp").set_level(rclcpp::Logger::Level::Error);
  for (const Measurement &measurement : measurements()) {
    if (!is_listed(measurement.name, only)) continue;
    auto all = contenders(workers);
    if (measurement.name == "arrivals_loaded" && all.back().name == "redag-os") {
      all.push_back({"redag-os-not-raised",
                     [&] { return redag_rclcpp::lab::make_redag(redag::PreemptionMode::Os, workers, false); }});
    }
    std::erase_if(all, [&](const Contender &kind) { return !is_listed(kind.name, executors); });
    std::map<std::string, std::map<std::string, std::vector<double>>> results;  // by figure, then by executor
    for (int round = 0; round < rounds; ++round) {
      for (const Contender &kind : all) {
        const auto executor = kind.make();
        for (const auto &[figure, value] : measurement.run(*executor, seconds))
          results[figure][kind.name].push_back(value);
      }
    }
    std::printf("%s\n", measurement.name.c_str());
    for (auto &[figure, by_kind] : results) {
      std::printf("  %-14s", figure.c_str());
      for (const Contender &kind : all) {
        const auto [least, most] = std::minmax_element(by_kind[kind.name].begin(), by_kind[kind.name].end());
        std::printf("  %s %.3g (%.3g to %.3g)", kind.name.c_str(), median(by_kind[kind.name]), *least, *most);
      }
      std::printf("\n");
    }
    std::fflush(stdout);
  }
  rclcpp::shutdown();
}
