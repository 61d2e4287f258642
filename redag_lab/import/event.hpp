// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a recording of ros2_tracing says, event by event, without the library that reads it. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "redag/base/time.hpp"

namespace redag::lab {

/// An event of ros2_tracing, or of the kernel. Handles are addresses in the process; other members are 0 or empty.
struct RosEvent {
  enum class Kind : std::uint8_t {
    NodeInit,              // handle: node; name, space
    PublisherInit,         // handle: publisher; other: node; name: topic
    SubscriptionInit,      // handle: subscription of rcl; other: node; third: subscription of rmw; name: topic
    SubscriptionObject,    // handle: subscription of rcl; other: object of rclcpp
    SubscriptionCallback,  // handle: object of rclcpp; other: callback
    ServiceInit,           // handle: service; other: node; name
    TimerInit,             // handle: timer; value: period
    CallbackAdded,         // handle: timer or service; other: callback
    TimerNode,             // handle: timer; other: node
    Start,                 // handle: callback; value: 1 if the message came intra-process
    End,                   // handle: callback
    Publish,               // handle: publisher
    IntraPublish,          // handle: publisher
    Take,                  // handle: subscription of rmw; value: when the message was sent, 0 if none was there
    Dispatch,              // handle: callback of a subscription; value: when the message was sent (before Humble)
    Group,                 // handle: callback group; name: its type (CARET)
    GroupMember,           // handle: timer, subscription of rcl, or service; other: callback group (CARET)
    Executor,              // the thread is one of an executor
    Look,                  // the same: it looks for work in what the last wait returned
    Wait,                  // the same: it waits for entities to be ready
    Switch,                // of the kernel: thread `handle` leaves a processor, thread `other` gets it
  };

  Kind kind = Kind::Executor;
  Time time = 0;
  Time created = 0;  // of an object that CARET recorded later; 0: at `time`
  std::uint32_t process = 0;
  std::uint32_t thread = 0;
  std::uint64_t handle = 0;
  std::uint64_t other = 0;
  std::uint64_t third = 0;
  std::int64_t value = 0;
  std::string_view name = {};   // valid during the call that passes the event
  std::string_view space = {};  // namespace of a node
  std::string_view program = {};
};

/// An event by its name in the trace, with the names of the fields that its members come from.
struct RosEventName {
  std::string_view name;
  RosEvent::Kind kind;
  const char *handle = nullptr;
  const char *other = nullptr;
  const char *third = nullptr;
  const char *value = nullptr;
  const char *text = nullptr;
};

/// The fields of ros2_tracing since Galactic, and of CARET's additional events. A field that a distribution lacks stays
/// 0.
inline constexpr std::array kRosEventNames = {
    RosEventName{"ros2:rcl_node_init", RosEvent::Kind::NodeInit, "node_handle", nullptr, nullptr, nullptr, "node_name"},
    RosEventName{"ros2:rcl_publisher_init", RosEvent::Kind::PublisherInit, "publisher_handle", "node_handle", nullptr,
                 nullptr, "topic_name"},
    RosEventName{"ros2:rcl_subscription_init", RosEvent::Kind::SubscriptionInit, "subscription_handle", "node_handle",
                 "rmw_subscription_handle", nullptr, "topic_name"},
    RosEventName{"ros2:rclcpp_subscription_init", RosEvent::Kind::SubscriptionObject, "subscription_handle",
                 "subscription"},
    RosEventName{"ros2:rclcpp_subscription_callback_added", RosEvent::Kind::SubscriptionCallback, "subscription",
                 "callback"},
    RosEventName{"ros2:rcl_service_init", RosEvent::Kind::ServiceInit, "service_handle", "node_handle", nullptr,
                 nullptr, "service_name"},
    RosEventName{"ros2:rclcpp_service_callback_added", RosEvent::Kind::CallbackAdded, "service_handle", "callback"},
    RosEventName{"ros2:rcl_timer_init", RosEvent::Kind::TimerInit, "timer_handle", nullptr, nullptr, "period"},
    RosEventName{"ros2:rclcpp_timer_callback_added", RosEvent::Kind::CallbackAdded, "timer_handle", "callback"},
    RosEventName{"ros2:rclcpp_timer_link_node", RosEvent::Kind::TimerNode, "timer_handle", "node_handle"},
    RosEventName{"ros2:callback_start", RosEvent::Kind::Start, "callback", nullptr, nullptr, "is_intra_process"},
    RosEventName{"ros2:callback_end", RosEvent::Kind::End, "callback"},
    RosEventName{"ros2:rcl_publish", RosEvent::Kind::Publish, "publisher_handle"},
    RosEventName{"ros2:rclcpp_intra_publish", RosEvent::Kind::IntraPublish, "publisher_handle"},
    RosEventName{"ros2:rmw_take", RosEvent::Kind::Take, "rmw_subscription_handle", nullptr, nullptr,
                 "source_timestamp"},
    RosEventName{"ros2:dispatch_subscription_callback", RosEvent::Kind::Dispatch, "callback", nullptr, nullptr,
                 "source_stamp"},
    RosEventName{"ros2_caret:add_callback_group", RosEvent::Kind::Group, "callback_group_addr", nullptr, nullptr,
                 nullptr, "group_type_name"},
    RosEventName{"ros2_caret:callback_group_add_timer", RosEvent::Kind::GroupMember, "timer_handle",
                 "callback_group_addr"},
    RosEventName{"ros2_caret:callback_group_add_subscription", RosEvent::Kind::GroupMember, "subscription_handle",
                 "callback_group_addr"},
    RosEventName{"ros2_caret:callback_group_add_service", RosEvent::Kind::GroupMember, "service_handle",
                 "callback_group_addr"},
    RosEventName{"ros2:rclcpp_executor_get_next_ready", RosEvent::Kind::Look},
    RosEventName{"ros2:rclcpp_executor_wait_for_work", RosEvent::Kind::Wait},
    RosEventName{"ros2:rclcpp_executor_execute", RosEvent::Kind::Executor},
    RosEventName{"sched_switch", RosEvent::Kind::Switch, "prev_tid", "next_tid"},
};

}  // namespace redag::lab
