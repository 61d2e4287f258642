// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "isolated_peer.hpp"

#if __has_include("callback_isolated_executor/callback_isolated_executor.hpp")
#define REDAG_HAS_CIE 1
#else
#define REDAG_HAS_CIE 0
#endif

#if REDAG_HAS_CIE
#include <fmt/format.h>
#include <sched.h>
#include <stdlib.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "ament_index_cpp/get_package_prefix.hpp"
#include "callback_isolated_executor/callback_isolated_executor.hpp"
#include "cie_thread_configurator/cie_thread_configurator.hpp"
#include "phased_timer.hpp"
#else
#include "redag/base/check.hpp"
#endif

namespace redag_rclcpp::lab {

#if REDAG_HAS_CIE
namespace {

namespace fs = std::filesystem;
constexpr const char *kTopic = "/cie_thread_configurator/callback_group_info";
constexpr std::chrono::milliseconds kLook(5);

// SCHED_FIFO priorities of this process's threads, ascending.
std::vector<int> fifo_priorities() {
  std::vector<int> found;
  for (const fs::directory_entry &thread : fs::directory_iterator("/proc/self/task")) {
    const pid_t id = std::stoi(thread.path().filename().string());
    sched_param parameters{};
    // A thread can end between the two calls; it has no priority then.
    if (sched_getscheduler(id) == SCHED_FIFO && sched_getparam(id, &parameters) == 0) {
      found.push_back(parameters.sched_priority);
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

redag::Result<void> check_isolated() { return {}; }

std::unique_ptr<rclcpp::Executor> make_isolated() { return std::make_unique<CallbackIsolatedExecutor>(); }

ThreadConfigurator::ThreadConfigurator(const std::vector<rclcpp::Node::SharedPtr> &nodes,
                                       const std::map<std::string, IsolatedNode> &settings)
    : folder_((fs::temp_directory_path() / "run_workload_cie.XXXXXX").string()), nodes_(nodes) {
  if (mkdtemp(folder_.data()) == nullptr) throw std::runtime_error("cannot make a folder such as " + folder_);
  std::string text = "callback_groups:\n";
  for (const rclcpp::Node::SharedPtr &node : nodes) {
    const auto base = node->get_node_base_interface();
    const IsolatedNode &setting = settings.at(node->get_fully_qualified_name());
    base->for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
      if (group == base->get_default_callback_group()) return;
      std::string id = cie_thread_configurator::create_callback_group_id(group, base);
      for (const redag::Duration period : setting.timers) id += fmt::format("@Timer({})", period);
      text += fmt::format("  - {{id: \"{}\", affinity: ~, policy: SCHED_FIFO, priority: {}}}\n", id, setting.priority);
      expected_.push_back(setting.priority);
    });
  }
  std::sort(expected_.begin(), expected_.end());
  const std::string file = folder_ + "/threads.yaml";
  std::ofstream(file) << text;
  const std::string program = ament_index_cpp::get_package_prefix("cie_thread_configurator") +
                              "/lib/cie_thread_configurator/thread_configurator_node";
  process_ = std::make_unique<ChildProcess>(std::vector<std::string>{program, "--config-file", file},
                                            folder_ + "/thread_configurator.log");
}

ThreadConfigurator::~ThreadConfigurator() {
  process_.reset();  // kills it if it still runs
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

redag::Result<void> ThreadConfigurator::wait_until_they_listen(std::size_t processes, redag::Duration timeout) const {
  const redag::Time end = timer_clock_now() + timeout;
  while (nodes_.front()->count_subscribers(kTopic) < processes) {
    if (timer_clock_now() > end) {
      return redag::make_error(
          fmt::format("the thread configurators of CIE do not listen within {}", redag::format_duration(timeout)),
          "check that 'thread_configurator_node' of cie_thread_configurator starts");
    }
    std::this_thread::sleep_for(kLook);
  }
  return {};
}

redag::Result<void> ThreadConfigurator::wait_for_priorities(redag::Time deadline) const {
  for (;;) {
    const std::vector<int> present = fifo_priorities();
    if (std::includes(present.begin(), present.end(), expected_.begin(), expected_.end())) return {};
    if (timer_clock_now() > deadline) {
      return redag::make_error(fmt::format("CIE's threads should have the SCHED_FIFO priorities {} before the start, "
                                           "but the process has {}",
                                           fmt::join(expected_, ", "), fmt::join(present, ", ")),
                               "its thread configurator needs the right to set real-time priorities");
    }
    std::this_thread::sleep_for(kLook);
  }
}

#else

redag::Result<void> check_isolated() {
  return redag::make_error("redag_rclcpp_lab was built without the executor 'cie'",
                           "build the packages of github.com/autowarefoundation/callback_isolated_executor in the "
                           "workspace, then redag_rclcpp_lab again");
}

std::unique_ptr<rclcpp::Executor> make_isolated() {
  REDAG_CHECK(false, "there is no such executor");
  return nullptr;
}

ThreadConfigurator::ThreadConfigurator(const std::vector<rclcpp::Node::SharedPtr> &,
                                       const std::map<std::string, IsolatedNode> &) {}
ThreadConfigurator::~ThreadConfigurator() = default;
redag::Result<void> ThreadConfigurator::wait_until_they_listen(std::size_t, redag::Duration) const {
  return check_isolated();
}
redag::Result<void> ThreadConfigurator::wait_for_priorities(redag::Time) const { return check_isolated(); }

#endif

}  // namespace redag_rclcpp::lab
