// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors that every conformance test runs with.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "redag_rclcpp/executor.hpp"
#include "redag_rclcpp/rclcpp_executors.hpp"

namespace redag_rclcpp {

template <redag::PreemptionMode kMode>
class ReDAGWith : public ReDAGExecutor {
 public:
  ReDAGWith() : ReDAGExecutor(options()) {}

 private:
  static ReDAGOptions options() {
    ReDAGOptions options;
    options.preemption = kMode;
    options.workers = 2;
    return options;
  }
};
using ReDAGNone = ReDAGWith<redag::PreemptionMode::None>;
using ReDAGCooperative = ReDAGWith<redag::PreemptionMode::Cooperative>;
using ReDAGOs = ReDAGWith<redag::PreemptionMode::Os>;

#if REDAG_HAS_EVENTS
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"  // on newer distributions
using EventsExecutor = rclcpp::experimental::executors::EventsExecutor;
#pragma GCC diagnostic pop
#endif

using OurTypes = ::testing::Types<ReDAGNone, ReDAGCooperative, ReDAGOs>;
using AllTypes = ::testing::Types<ReDAGNone, ReDAGCooperative, ReDAGOs, rclcpp::executors::SingleThreadedExecutor,
                                  rclcpp::executors::MultiThreadedExecutor
#if REDAG_HAS_EVENTS
                                  ,
                                  EventsExecutor
#endif
#if REDAG_HAS_CBG
                                  ,
                                  rclcpp::executors::EventsCBGExecutor
#endif
                                  >;

#if REDAG_HAS_CBG
template <class T>
inline constexpr bool kCbg = std::is_same_v<T, rclcpp::executors::EventsCBGExecutor>;
#else
template <class T>
inline constexpr bool kCbg = false;
#endif

struct TypeNames {
  template <class T>
  static std::string GetName(int) {
    if (std::is_same_v<T, ReDAGNone>) return "redag_none";
    if (std::is_same_v<T, ReDAGCooperative>) return "redag_cooperative";
    if (std::is_same_v<T, ReDAGOs>) return "redag_os";
    if (std::is_same_v<T, rclcpp::executors::SingleThreadedExecutor>) return "single_threaded";
    if (std::is_same_v<T, rclcpp::executors::MultiThreadedExecutor>) return "multi_threaded";
    return kCbg<T> ? "cbg" : "events";
  }
};

/// True if T executes callbacks of several groups at the same time.
template <class T>
inline constexpr bool kParallel =
    std::is_base_of_v<ReDAGExecutor, T> || std::is_same_v<T, rclcpp::executors::MultiThreadedExecutor> || kCbg<T>;

template <class T>
inline constexpr bool kOurs = std::is_base_of_v<ReDAGExecutor, T>;

#if REDAG_HAS_EVENTS
template <class T>
inline constexpr bool kEvents = std::is_same_v<T, EventsExecutor>;
#else
template <class T>
inline constexpr bool kEvents = false;
#endif

/// True if T needs no SCHED_FIFO, or if this machine permits it.
template <class T>
bool can_run() {
  return !std::is_same_v<T, ReDAGOs> || redag::runtime::probe_priority_band().top_job > 0;
}

}  // namespace redag_rclcpp
