// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// All executors of rclcpp that this distribution and workspace have, for tests and comparisons. A macro tells for each
// that some lack.
#pragma once

#include "rclcpp/executors.hpp"
#if __has_include("rclcpp/executors/static_single_threaded_executor.hpp")
#define REDAG_HAS_STATIC 1
#else
#define REDAG_HAS_STATIC 0
#endif
#if __has_include("rclcpp/experimental/executors/events_executor/events_executor.hpp")
#include "rclcpp/experimental/executors/events_executor/events_executor.hpp"
#define REDAG_HAS_EVENTS 1
#else
#define REDAG_HAS_EVENTS 0
#endif
// rclcpp has it since Lyrical, and in updates of Jazzy and Kilted. Elsewhere it is in the package cm_executors.
#if __has_include("rclcpp/executors/events_cbg_executor/events_cbg_executor.hpp")
#include "rclcpp/executors/events_cbg_executor/events_cbg_executor.hpp"
#define REDAG_HAS_CBG 1
#elif __has_include("cm_executors/events_cbg_executor.hpp")
#include "cm_executors/events_cbg_executor.hpp"
#define REDAG_HAS_CBG 1
#else
#define REDAG_HAS_CBG 0
#endif
