// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// AnyWaitable is a base for waitables. Its virtual functions have the same parameters on every distribution.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "rclcpp/timer.hpp"
#include "rclcpp/version.h"
#include "rclcpp/waitable.hpp"

namespace redag_rclcpp {

/// True if executors ask waitables for their timers.
#if RCLCPP_VERSION_GTE(29, 4, 0)
inline constexpr bool kWaitablesHaveTimers = true;
#else
inline constexpr bool kWaitablesHaveTimers = false;
#endif

class AnyWaitable : public rclcpp::Waitable {
 public:
  virtual void fill(rcl_wait_set_t &set) = 0;
  virtual bool is_ready_in(const rcl_wait_set_t &set) = 0;
  virtual void run(const std::shared_ptr<void> &data) = 0;
  /// Not called unless kWaitablesHaveTimers.
  [[nodiscard]] virtual std::vector<std::shared_ptr<rclcpp::TimerBase>> own_timers() const { return {}; }

  std::shared_ptr<void> take_data() override { return nullptr; }
  std::shared_ptr<void> take_data_by_entity_id(std::size_t) override { return take_data(); }
#if RCLCPP_VERSION_MAJOR >= 28
  void add_to_wait_set(rcl_wait_set_t &set) final { fill(set); }
  bool is_ready(const rcl_wait_set_t &set) final { return is_ready_in(set); }
  void execute(const std::shared_ptr<void> &data) final { run(data); }
#else
  void add_to_wait_set(rcl_wait_set_t *set) final { fill(*set); }
  bool is_ready(rcl_wait_set_t *set) final { return is_ready_in(*set); }
  void execute(std::shared_ptr<void> &data) final { run(data); }
#endif
#if RCLCPP_VERSION_GTE(29, 4, 0)
  std::vector<std::shared_ptr<rclcpp::TimerBase>> get_timers() const final { return own_timers(); }
#endif
};

}  // namespace redag_rclcpp
