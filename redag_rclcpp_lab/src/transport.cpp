// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "transport.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "rclcpp/rclcpp.hpp"
#include "redag_rclcpp/executor.hpp"
#include "rmw/rmw.h"
#include "std_msgs/msg/int64_multi_array.hpp"

namespace redag_rclcpp::lab {
namespace {

using Message = std_msgs::msg::Int64MultiArray;
using redag::Duration;
using redag::Time;

constexpr std::int64_t kWarmUp = 20;         // first messages of each size, which are not counted
constexpr Duration kGrace = redag::kSecond;  // after the last message of a size

// Of all processes of the machine.
Time now() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec * redag::kSecond + time.tv_nsec;
}

std::string topic_of(pid_t sender, std::size_t bytes) { return fmt::format("/redag_transport_{}/b{}", sender, bytes); }

rclcpp::QoS quality(const TransportOptions &options) {
  rclcpp::QoS quality(10);
  return options.reliable ? quality.reliable() : quality.best_effort();
}

// Numbers through a pipe. False: the other end is gone.
bool write_all(int pipe, const void *data, std::size_t size) {
  const char *at = static_cast<const char *>(data);
  while (size > 0) {
    const ssize_t count = ::write(pipe, at, size);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    at += count;
    size -= static_cast<std::size_t>(count);
  }
  return true;
}

bool read_all(int pipe, void *data, std::size_t size) {
  char *at = static_cast<char *>(data);
  while (size > 0) {
    const ssize_t count = ::read(pipe, at, size);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    at += count;
    size -= static_cast<std::size_t>(count);
  }
  return true;
}

// The child: receives until `control` is closed, then writes the latencies of each size to `results`.
int receive(const TransportOptions &options, pid_t sender, int control, int results) {
  rclcpp::init(0, nullptr, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  const auto node = std::make_shared<rclcpp::Node>("transport_receiver");
  std::vector<std::vector<Duration>> latencies(options.sizes.size());
  std::vector<rclcpp::Subscription<Message>::SharedPtr> subscriptions;
  for (std::size_t i = 0; i < options.sizes.size(); ++i) {
    const auto take = [&of_size = latencies[i]](const Message &message) {
      const Time arrived = now();
      if (message.data.at(0) >= kWarmUp) of_size.push_back(arrived - message.data.at(1));
    };
    subscriptions.push_back(
        node->create_subscription<Message>(topic_of(sender, options.sizes[i]), quality(options), take));
  }
  ReDAGExecutor executor{ReDAGOptions{}};
  executor.add_node(node);
  std::thread spinner([&executor] { executor.spin(); });
  char end = 0;
  (void)read_all(control, &end, 1);  // nothing is ever written
  rclcpp::shutdown();                // also ends a spin() that has not begun yet, as cancel() would not
  spinner.join();
  for (const std::vector<Duration> &of_size : latencies) {
    const std::uint64_t count = of_size.size();
    if (!write_all(results, &count, sizeof(count)) || !write_all(results, of_size.data(), count * sizeof(Duration))) {
      return 1;
    }
  }
  return 0;
}

// The parent: publishes all sizes, one after the other. Error: no subscription in time.
redag::Result<std::vector<TransportFigures>> send(const TransportOptions &options) {
  const auto node = std::make_shared<rclcpp::Node>("transport_sender");
  std::vector<TransportFigures> all;
  std::vector<rclcpp::Publisher<Message>::SharedPtr> publishers;
  for (const std::size_t bytes : options.sizes) {
    publishers.push_back(node->create_publisher<Message>(topic_of(getpid(), bytes), quality(options)));
  }
  const auto is_stopped = [&] { return options.stop && options.stop(); };
  for (const Time end = now() + options.patience;
       std::any_of(publishers.begin(), publishers.end(),
                   [](const auto &each) { return each->get_subscription_count() == 0; });) {
    if (now() > end || is_stopped()) {
      return redag::make_error("the two processes have not found each other",
                               "check ROS_DOMAIN_ID and the middleware's configuration");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  for (std::size_t i = 0; i < options.sizes.size(); ++i) {
    TransportFigures &figures = all.emplace_back();
    figures.bytes = options.sizes[i];
    Message message;
    message.data.resize(options.sizes[i] / sizeof(std::int64_t));
    const std::int64_t count = kWarmUp + std::max<Duration>(1, options.duration / options.period);
    auto next = std::chrono::steady_clock::now();
    for (std::int64_t number = 0; number < count && !is_stopped(); ++number) {
      std::this_thread::sleep_until(next);
      next += std::chrono::nanoseconds(options.period);
      message.data[0] = number;
      message.data[1] = now();
      publishers[i]->publish(message);
      if (number >= kWarmUp) ++figures.sent;
    }
    std::this_thread::sleep_for(std::chrono::nanoseconds(kGrace));
  }
  return all;
}

}  // namespace

redag::Result<std::vector<TransportFigures>> measure_transport(const TransportOptions &options) {
  int control[2];
  int results[2];
  if (pipe(control) != 0 || pipe(results) != 0) return redag::make_error("cannot create pipes");
  const pid_t sender = getpid();
  const pid_t child = fork();
  if (child < 0) return redag::make_error("cannot fork");
  if (child == 0) {
    close(control[1]);
    close(results[0]);
    // Ctrl-C ends the parent's messages, and then this process.
    std::signal(SIGINT, SIG_IGN);
    int status = 1;
    try {
      status = receive(options, sender, control[0], results[1]);
    } catch (const std::exception &error) {
      fmt::print(stderr, "the receiver failed: {}\n", error.what());
    }
    std::fflush(nullptr);
    _exit(status);
  }
  close(control[0]);
  close(results[1]);
  rclcpp::init(0, nullptr, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  redag::Result<std::vector<TransportFigures>> sent = send(options);
  rclcpp::shutdown();
  close(control[1]);
  bool is_complete = true;
  for (std::size_t i = 0; sent && i < sent->size(); ++i) {
    std::uint64_t count = 0;
    is_complete = is_complete && read_all(results[0], &count, sizeof(count)) && count <= (*sent)[i].sent;
    if (!is_complete) break;
    (*sent)[i].latencies.resize(count);
    is_complete = read_all(results[0], (*sent)[i].latencies.data(), count * sizeof(Duration));
    std::sort((*sent)[i].latencies.begin(), (*sent)[i].latencies.end());
  }
  close(results[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (sent && (!is_complete || status != 0)) return redag::make_error("the receiving process ended early");
  return sent;
}

Duration quantile(const TransportFigures &figures, double share) {
  const auto count = static_cast<double>(figures.latencies.size());
  const auto place = static_cast<std::size_t>(std::max(0.0, std::ceil(share * count) - 1));
  return figures.latencies[std::min(place, figures.latencies.size() - 1)];
}

Duration stated_transport(const TransportFigures &figures, double margin) {
  const double scaled = static_cast<double>(figures.latencies.back()) * margin;
  return static_cast<Duration>(std::ceil(scaled / static_cast<double>(redag::kMicrosecond))) * redag::kMicrosecond;
}

std::string describe(const std::vector<TransportFigures> &all, double margin) {
  std::string text = fmt::format("{:>9}  {:>9}  {:>5}  {:>9}  {:>9}  {:>9}  {:>9}\n", "bytes", "received", "lost",
                                 "p50", "p99", "p99.9", "max");
  std::string lines;
  for (const TransportFigures &figures : all) {
    const std::size_t received = figures.latencies.size();
    text += fmt::format("{:>9}  {:>9}  {:>5}", figures.bytes, received, figures.sent - received);
    if (received == 0) {
      text += "  nothing arrived\n";
      continue;
    }
    for (const double share : {0.5, 0.99, 0.999, 1.0}) {
      text += fmt::format("  {:>9}", redag::humanize_duration(quantile(figures, share)));
    }
    text += "\n";
    lines += fmt::format("transport: {}  # {} bytes: the largest of {} latencies, {}, times {}\n",
                         redag::format_duration(stated_transport(figures, margin)), figures.bytes, received,
                         redag::humanize_duration(figures.latencies.back()), margin);
  }
  return text + "\n" + lines +
         "A measured maximum is no bound: a longer measurement, or another load, can find a larger one.\n";
}

std::string to_json(const std::vector<TransportFigures> &all, const TransportOptions &options, double margin) {
  nlohmann::ordered_json document = {{"format", "redag.transport/1"},
                                     {"middleware", rmw_get_implementation_identifier()},
                                     {"reliable", options.reliable},
                                     {"period_ns", options.period},
                                     {"margin", margin},
                                     {"sizes", nlohmann::ordered_json::array()}};
  for (const TransportFigures &figures : all) {
    nlohmann::ordered_json row = {
        {"bytes", figures.bytes}, {"sent", figures.sent}, {"received", figures.latencies.size()}};
    if (!figures.latencies.empty()) {
      row["min_ns"] = figures.latencies.front();
      for (const auto &[name, share] : {std::pair{"p50_ns", 0.5}, {"p99_ns", 0.99}, {"p999_ns", 0.999}}) {
        row[name] = quantile(figures, share);
      }
      row["max_ns"] = figures.latencies.back();
      row["transport_ns"] = stated_transport(figures, margin);
    }
    document["sizes"].push_back(std::move(row));
  }
  return document.dump(2) + "\n";
}

}  // namespace redag_rclcpp::lab
