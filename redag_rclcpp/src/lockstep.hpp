// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lockstep runs the callbacks of one instant of simulated time after the other, as a player announces them. An instant
// begins when all of the player's messages have arrived and the nodes' clocks show its time. Its timers and messages
// are then released together, in the order of names. It ends when no job is left to run. The scheduler orders jobs by
// priority and turn; in lockstep, turns are numbers that this class gives, and no times of arrival.
//
// Threads: the thread that called spin() calls look(), wait() and close(). Workers and the middleware's threads call
// the functions that say so.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "callback.hpp"
#include "node_clocks.hpp"
#include "rclcpp/node.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag_rclcpp/lockstep.hpp"
#include "registry.hpp"
#include "std_msgs/msg/string.hpp"

namespace redag_rclcpp {

class Lockstep {
 public:
  /// The other parts of the executor, which outlive this one.
  struct Parts {
    redag::runtime::Engine &engine;
    Registry &registry;
    std::function<void()> wake;  // makes the thread that called spin() call look()
    std::function<std::string(redag::TaskId)> name_of;
  };
  Lockstep(rclcpp::Context::SharedPtr context, Time origin, Parts parts);
  ~Lockstep();

  /// Makes the executor known to players. Call it at the beginning of each spin(), and close() at its end.
  void open();
  void close();

  /// Does what there is to do. May take long only where entities are collected.
  void look();
  /// When look() has to be called again, on the engine's clock.
  [[nodiscard]] Time next_look() const { return next_look_; }
  /// True while jobs of an instant run. Entities must not be collected then. wait() is to be called before look().
  [[nodiscard]] bool in_instant() const { return state_ == State::Running; }
  /// Waits until the instant's jobs have ended, at most until then.
  void wait(Time until);

  // ---- any thread ----

  /// True while a player is followed: its messages and simulated timers wait for an instant.
  [[nodiscard]] bool follows() const { return follows_; }
  /// The turn of a job that is released now.
  [[nodiscard]] Time turn() const;
  /// Wakes the thread that waits for messages of the player. The caller holds no lock of this package.
  void arrived() { parts_.wake(); }
  /// Something was released that is in no recording: by a clock on the wall, or by a message from elsewhere.
  void came_from_outside(const Callback &callback);
  /// A job of this callback has run.
  void ran(const Callback &callback);

 private:
  enum class State : std::uint8_t { Free, Connecting, Between, Gathering, Running };
  using Report = lockstep::Report;
  using Order = lockstep::Order;

  void take_orders();
  void obey(const Order &order);
  void begin(const Order &order);
  void end(const char *why);
  void refresh();
  [[nodiscard]] std::string unconnected() const;
  [[nodiscard]] std::string missing() const;
  void start_instant();
  void end_instant();
  void warn_without_player();
  void report(Report::Kind kind, std::string text = {});
  void fail(const std::string &text);
  void set_state(State state);

  const rclcpp::Context::SharedPtr context_;
  const Time origin_;  // zero of the engine's clock, on CLOCK_MONOTONIC
  const Parts parts_;
  NodeClocks clocks_;
  std::string name_;
  std::shared_ptr<rclcpp::Node> node_;
  rclcpp::Subscription<std_msgs::msg::String>::SharedPtr orders_;
  rclcpp::Publisher<std_msgs::msg::String>::SharedPtr reports_;

  State state_ = State::Free;
  Order order_;                                       // the player's last
  std::map<std::string, std::uint64_t> published_;    // by the player, of all its topics
  std::vector<std::shared_ptr<Callback>> paced_;      // subscriptions of these topics
  std::vector<std::shared_ptr<Callback>> callbacks_;  // all, in the order of names
  std::uint64_t seen_change_ = ~std::uint64_t{0};     // of the registry
  bool clocks_held_ = false;
  bool connected_ = false;    // callbacks have not changed since they all had the player
  bool quiet_ = false;        // what wait() has seen
  bool warned_free_ = false;  // that callbacks run without a player
  Time since_ = 0;            // of the state
  Time told_ = 0;             // last report
  Time next_look_ = redag::kNever;
  std::string said_;  // last text of a report that was logged

  std::atomic<bool> follows_{false};
  std::atomic<bool> running_{false};  // the state is Running
  std::atomic<Time> turn_{0};
  std::atomic<std::uint64_t> jobs_{0};
  std::atomic<std::uint64_t> hash_{0};
  std::atomic<bool> came_free_{false};  // something came from outside while no player was followed

  mutable redag::PiMutex outside_lock_;
  std::string first_free_ REDAG_GUARDED_BY(outside_lock_);                        // see came_free_
  std::map<std::string, std::uint64_t> outside_ REDAG_GUARDED_BY(outside_lock_);  // by callback
};

}  // namespace redag_rclcpp
