// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What differs between ROS 2 distributions in the interfaces that this package implements: Humble has rclcpp 16, Jazzy
// 28, Kilted 29, Lyrical 32. Types are taken from rclcpp's own declarations, so that this needs few versions. This
// header and src/compat.hpp are the only files that ask for a version; tools/check_layers sees to it.
#pragma once

#include "rclcpp/executor.hpp"
#include "rclcpp/version.h"

/// `override` if the function of rclcpp::Executor is virtual: cancel() since Jazzy, the other one since Iron.
#if RCLCPP_VERSION_MAJOR >= 28
#define REDAG_RCLCPP_OVERRIDES_CANCEL override
#else
#define REDAG_RCLCPP_OVERRIDES_CANCEL
#endif
#if RCLCPP_VERSION_MAJOR >= 21
#define REDAG_RCLCPP_OVERRIDES_SPIN_UNTIL_FUTURE_COMPLETE override
#else
#define REDAG_RCLCPP_OVERRIDES_SPIN_UNTIL_FUTURE_COMPLETE
#endif

/// 1 if the callback of a timer may take a rclcpp::TimerInfo.
#if RCLCPP_VERSION_MAJOR >= 28
#define REDAG_RCLCPP_HAS_TIMER_INFO 1
#else
#define REDAG_RCLCPP_HAS_TIMER_INFO 0
#endif

namespace redag_rclcpp::distribution {

template <class Function>
struct Arguments;
template <class Group, class Node>
struct Arguments<void (rclcpp::Executor::*)(Group, Node, bool)> {
  using GroupPointer = Group;
  using NodePointer = Node;
};

/// Parameters of add_callback_group() and its like: a shared pointer, since Lyrical a reference to one.
using GroupPointer = Arguments<decltype(&rclcpp::Executor::add_callback_group)>::GroupPointer;
using NodePointer = Arguments<decltype(&rclcpp::Executor::add_callback_group)>::NodePointer;

}  // namespace redag_rclcpp::distribution
