// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How old are the data behind a control output? A camera of 30 Hz and a lidar of 10 Hz, which nothing synchronises, are
// fused. A control loop of 100 Hz uses the latest result, beside callbacks of 60 and 200 ms. ReDAGExecutor with join()
// and the edges of config/stacks/fusion.yaml, against rclcpp's MultiThreadedExecutor with message_filters. Built if the
// packages message_filters and sensor_msgs are present.
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "ament_index_cpp/get_package_share_directory.hpp"
#include "contenders.hpp"
#include "message_filters/subscriber.h"
#include "message_filters/sync_policies/approximate_time.h"
#include "message_filters/synchronizer.h"
#include "rclcpp/rclcpp.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/threads/clock.hpp"
#include "redag_rclcpp/join.hpp"
#include "samples.hpp"
#include "sensor_msgs/msg/temperature.hpp"
#include "stack_comparison.hpp"

namespace {

using namespace std::chrono_literals;
using redag_rclcpp::lab::Figures;
using redag_rclcpp::lab::Samples;
using redag_rclcpp::lab::StackOptions;
using redag_rclcpp::lab::StackRun;
using Message = sensor_msgs::msg::Temperature;
using std::chrono::nanoseconds;

constexpr double kWarmUp = 1;  // seconds at the start that are left out

std::int64_t now_ns() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

std::int64_t stamp_of(const Message &message) { return redag_rclcpp::detail::stamp_of(message); }

// Uses as much processor time, so that a callback that is preempted takes longer.
void compute(nanoseconds time) {
  const redag::Time end = redag::runtime::thread_cpu_now() + time.count();
  while (redag::runtime::thread_cpu_now() < end) {
  }
}

// The latest result of the fusion.
struct Fused {
  std::atomic<std::int64_t> camera{0};  // when the data were seen, in ns
  std::atomic<std::int64_t> lidar{0};
};

struct Ages {
  Samples camera;
  Samples lidar;
};

class Robot {
 public:
  explicit Robot(bool filters) {
    add_sensor("camera", 33333333ns, 3ms);
    add_sensor("lidar", 100ms, 5ms);
    const auto fusion = add_node("fusion");
    if (filters) {
      using Policy = message_filters::sync_policies::ApproximateTime<Message, Message>;
      auto camera = std::make_shared<message_filters::Subscriber<Message>>(fusion, "camera");
      auto lidar = std::make_shared<message_filters::Subscriber<Message>>(fusion, "lidar");
      auto synchronizer = std::make_shared<message_filters::Synchronizer<Policy>>(Policy(10), *camera, *lidar);
      synchronizer->registerCallback(&Robot::fuse, this);
      kept_.insert(kept_.end(), {camera, lidar, synchronizer});
    } else {
      kept_.push_back(redag_rclcpp::join<Message, Message>(*fusion, {"camera", "lidar"}, rclcpp::QoS(10),
                                                           [this](const auto &...data) { fuse(data...); }));
    }
    add_timer("control", 10ms, [this] {
      compute(500us);
      const std::int64_t now = now_ns();
      if (now < measured_from_ || fused_.camera == 0) return;
      ages_.camera.add(now - fused_.camera);
      ages_.lidar.add(now - fused_.lidar);
    });
    add_timer("planner", 200ms, [] { compute(60ms); });
    add_timer("map", 500ms, [] { compute(200ms); });
  }

  // Runs for the warm-up and for `seconds`.
  Figures run(rclcpp::Executor &executor, double seconds) {
    const auto in_ns = [](double s) { return static_cast<std::int64_t>(s * 1e9); };
    measured_from_ = now_ns() + in_ns(kWarmUp);
    for (const auto &node : nodes_) executor.add_node(node);
    std::thread spinning([&] { executor.spin(); });
    std::this_thread::sleep_for(nanoseconds(in_ns(kWarmUp + seconds)));
    executor.cancel();
    spinning.join();
    for (const auto &node : nodes_) executor.remove_node(node);
    if (ages_.lidar.size() == 0) throw std::runtime_error("no data came to the control loop");
    Figures figures{{"control outputs a second", static_cast<double>(ages_.lidar.size()) / seconds},
                    {"fusions a second", fusions_ / (kWarmUp + seconds)}};
    const auto add = [&](const std::string &name, const Samples &ages) {
      redag_rclcpp::lab::add_samples(figures, name, ages);
      figures[name + ", ms, max"] = ages.milliseconds(1);
    };
    add("age of camera data", ages_.camera);
    add("age of lidar data", ages_.lidar);
    return figures;
  }

 private:
  void fuse(const Message::ConstSharedPtr &camera, const Message::ConstSharedPtr &lidar) {
    compute(4ms);
    fused_.camera = stamp_of(*camera);
    fused_.lidar = stamp_of(*lidar);
    ++fusions_;
  }

  rclcpp::Node::SharedPtr add_node(const std::string &name) {
    return nodes_.emplace_back(std::make_shared<rclcpp::Node>(name));
  }

  void add_timer(const std::string &name, nanoseconds period, std::function<void()> body) {
    kept_.push_back(add_node(name)->create_wall_timer(period, std::move(body)));
  }

  // The data are from the start of the sensor's callback.
  void add_sensor(const std::string &name, nanoseconds period, nanoseconds work) {
    const auto node = add_node(name);
    const auto publisher = node->create_publisher<Message>(name, rclcpp::QoS(10));
    kept_.push_back(node->create_wall_timer(period, [publisher, work] {
      Message message;
      const std::int64_t now = now_ns();
      message.header.stamp.sec = static_cast<std::int32_t>(now / 1'000'000'000);
      message.header.stamp.nanosec = static_cast<std::uint32_t>(now % 1'000'000'000);
      compute(work);
      publisher->publish(message);
    }));
  }

  Fused fused_;
  std::atomic<int> fusions_{0};
  std::int64_t measured_from_ = 0;
  Ages ages_;
  std::vector<rclcpp::Node::SharedPtr> nodes_;
  std::vector<std::shared_ptr<void>> kept_;
};

Figures measure(const StackRun &run, const StackOptions &options) {
  rclcpp::init(0, nullptr);
  const std::shared_ptr<void> end(nullptr, [](void *) { rclcpp::shutdown(); });
  rclcpp::get_logger("redag_rclcpp").set_level(rclcpp::Logger::Level::Error);
  Robot robot(run.contender == "mte filters");
  if (run.contender.rfind("mte", 0) == 0) {
    return robot.run(*redag_rclcpp::lab::make_peer("mte", 2), options.seconds);
  }
  redag_rclcpp::ReDAGOptions chosen;
  chosen.workers = 2;
  chosen.preemption = run.contender == "redag os" ? redag::PreemptionMode::Os : redag::PreemptionMode::None;
  if (options.config != "none") {
    const auto loaded = redag::load_workload(options.config);
    if (!loaded) throw std::runtime_error(to_string(loaded.error()));
    chosen.workload = redag::validated(loaded->workload).value();
  }
  redag_rclcpp::ReDAGExecutor executor(chosen);
  return robot.run(executor, options.seconds);
}

}  // namespace

int main(int argc, char **argv) {
  redag_rclcpp::lab::StackComparison comparison;
  comparison.program = "bench_fusion";
  comparison.description =
      "How old are camera and lidar data behind a control output? ReDAGExecutor and join(),\n"
      "against MultiThreadedExecutor and message_filters";
  comparison.explanation =
      "Prefix it with 'chrt -f 10' to give all executors real-time threads.\n\n"
      "Example:\n  ros2 run redag_rclcpp_lab bench_fusion --rounds 5 --seconds 20";
  comparison.config = ament_index_cpp::get_package_share_directory("redag_rclcpp") + "/config/stacks/fusion.yaml";
  comparison.contenders = {"mte filters", "mte join", "redag none"};
  if (redag::runtime::probe_priority_band().top_job > 0) comparison.contenders.emplace_back("redag os");
  comparison.add_options = [](CLI::App &) {};
  comparison.measure = measure;
  return redag_rclcpp::lab::run_comparison(comparison, argc, argv);
}
