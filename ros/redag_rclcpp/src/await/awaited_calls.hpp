// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The calls of one client that coroutines await. An arrival wakes jobs that await a response, and these take it
// themselves. They need no callback group for that: a job that waits holds its own. Responses of other calls that they
// take are set aside for the client's callback, which runs in the client's group.
//
// Each response is counted until an attempt to take it: as an arrival of the client's callback, or in `arrived_`.
// Threads: any. The lock is taken above those of callbacks and of the engine. It is not held while a request is sent or
// a response is taken: the middleware calls wake() with its locks held.
#pragma once

#include <rmw/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "rclcpp/client.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/runtime/async_event.hpp"

namespace redag_rclcpp {

struct Response {
  std::shared_ptr<rmw_request_id_t> id;
  std::shared_ptr<void> message;
};

/// The client's callback.
class ResponseCallback {
 public:
  virtual ~ResponseCallback() = default;
  /// `count` responses that others have set aside, or left in the middleware, are for the callback.
  virtual void leave_to_callback(std::size_t count) = 0;
};

class AwaitedCalls {
 public:
  /// A call, from before its request is sent until the job goes on. A part of the job.
  class Call {
   public:
    explicit Call(AwaitedCalls &calls);
    ~Call();
    Call(const Call &) = delete;
    Call &operator=(const Call &) = delete;

    /// Throws rclcpp's exceptions.
    void send(rclcpp::ClientBase &client, const void *request);
    /// Set when the call's response is there, or when the job should take() responses.
    [[nodiscard]] redag::AsyncEvent &event() { return event_; }
    /// Takes responses until that of this call is there, or none is left. Returns it, or null.
    [[nodiscard]] std::shared_ptr<void> take(rclcpp::ClientBase &client);

   private:
    friend class AwaitedCalls;

    AwaitedCalls &calls_;
    redag::AsyncEvent event_;
    const redag::runtime::Engine *engine_;
    redag::TaskId task_;
    // Guarded by the lock of calls_:
    bool sent_ = false;
    std::int64_t number_ = 0;  // of the request; once it is sent
    std::shared_ptr<void> response_;
  };

  /// Those of the client. Any calls of it share one object.
  [[nodiscard]] static std::shared_ptr<AwaitedCalls> of(const std::shared_ptr<rclcpp::ClientBase> &client);

  explicit AwaitedCalls(const std::shared_ptr<rclcpp::ClientBase> &client) : client_(client) {}

  /// From here on, arrivals are reported by wake().
  void attach(std::weak_ptr<ResponseCallback> callback);
  void detach();
  [[nodiscard]] bool is_attached() const { return attached_.load(std::memory_order_acquire); }

  /// `count` responses have arrived. Returns false if no call is awaited: they are for the client's callback.
  [[nodiscard]] bool wake(std::size_t count);
  /// For the client's callback. Returns a response that was set aside for it; without a message if there is none.
  [[nodiscard]] Response take_set_aside();
  /// For the client's callback, which has taken a response. Returns true if it was that of an awaited call.
  [[nodiscard]] bool deliver(const Response &response);

 private:
  /// Returns the awaited call with this request, and gives it the response.
  [[nodiscard]] Call *give(const Response &response) REDAG_REQUIRES(lock_);
  void put(Response response) REDAG_EXCLUDES(lock_);
  void wake_callers() REDAG_REQUIRES(lock_);
  [[nodiscard]] bool is_sending() const REDAG_REQUIRES(lock_);
  [[nodiscard]] std::size_t settle() REDAG_REQUIRES(lock_);
  void use_arrival() REDAG_REQUIRES(lock_);
  void leave_to_callback(std::size_t count) REDAG_EXCLUDES(lock_);

  const std::weak_ptr<rclcpp::ClientBase> client_;
  std::atomic<bool> attached_{false};
  std::atomic<std::size_t> awaited_{0};          // number of calls; written under the lock
  std::atomic<std::size_t> set_aside_count_{0};  // written under the lock

  redag::PiMutex taking_;  // of callers: the next attempt begins when the arrival of the last one has been used
  redag::PiMutex lock_;    // taken after it
  std::weak_ptr<ResponseCallback> callback_ REDAG_GUARDED_BY(lock_);
  std::vector<Call *> calls_ REDAG_GUARDED_BY(lock_);
  std::vector<redag::AsyncEvent *> woken_ REDAG_GUARDED_BY(lock_);  // wake_callers() only
  std::size_t arrived_ REDAG_GUARDED_BY(lock_) = 0;                 // in the middleware, and no arrival of the callback
  std::vector<Response> unknown_ REDAG_GUARDED_BY(lock_);           // may be that of a request which is being sent
  std::deque<Response> set_aside_ REDAG_GUARDED_BY(lock_);          // for the client's callback
};

}  // namespace redag_rclcpp
