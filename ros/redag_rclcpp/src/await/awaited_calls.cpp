// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "await/awaited_calls.hpp"

#include <rcl/client.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "entities/take.hpp"
#include "rclcpp/exceptions.hpp"
#include "redag/base/check.hpp"

namespace redag_rclcpp {
namespace {

struct Clients {
  redag::PiMutex lock;
  std::map<const rclcpp::ClientBase *, std::weak_ptr<AwaitedCalls>> calls REDAG_GUARDED_BY(lock);
};

// Never destroyed: nodes with static storage are destroyed when the process ends.
Clients &clients() {
  static auto &all = *new Clients;
  return all;
}

}  // namespace

std::shared_ptr<AwaitedCalls> AwaitedCalls::of(const std::shared_ptr<rclcpp::ClientBase> &client) {
  Clients &all = clients();
  const redag::LockGuard guard(all.lock);
  const auto known = all.calls.find(client.get());
  if (known != all.calls.end()) {
    // Another client may have had the same address.
    if (auto calls = known->second.lock(); calls && calls->client_.lock() == client) return calls;
  }
  std::erase_if(all.calls, [](const auto &entry) { return entry.second.expired(); });
  auto calls = std::make_shared<AwaitedCalls>(client);
  all.calls[client.get()] = calls;
  return calls;
}

void AwaitedCalls::attach(std::weak_ptr<ResponseCallback> callback) {
  const redag::LockGuard guard(lock_);
  callback_ = std::move(callback);
  attached_.store(true, std::memory_order_release);
}

void AwaitedCalls::detach() {
  const redag::LockGuard guard(lock_);
  callback_.reset();
  attached_.store(false, std::memory_order_release);
}

// A call is registered before its request is sent, so that no arrival of its response finds none. The events are set
// under the lock: a caller takes it before it destroys its own.
bool AwaitedCalls::wake(std::size_t count) {
  if (awaited_.load(std::memory_order_acquire) == 0) return false;
  const redag::LockGuard guard(lock_);
  if (calls_.empty()) return false;
  arrived_ += count;
  wake_callers();
  return true;
}

// Wakes one job of each task: jobs of different tasks can have different priorities, and none of them may depend on a
// less urgent one to take its response.
void AwaitedCalls::wake_callers() {
  woken_.clear();
  for (auto call = calls_.begin(); call != calls_.end(); ++call) {
    const auto is_of_task = [&](const Call *other) {
      return other->task_ == (*call)->task_ && other->engine_ == (*call)->engine_;
    };
    if (std::none_of(calls_.begin(), call, is_of_task)) woken_.push_back(&(*call)->event_);
  }
  redag::AsyncEvent::set_all(woken_);
}

AwaitedCalls::Call *AwaitedCalls::give(const Response &response) {
  const auto found = std::find_if(calls_.begin(), calls_.end(), [&](const Call *call) {
    return call->sent_ && call->number_ == response.id->sequence_number;
  });
  if (found == calls_.end()) return nullptr;
  (*found)->response_ = response.message;
  return *found;
}

bool AwaitedCalls::is_sending() const {
  return std::any_of(calls_.begin(), calls_.end(), [](const Call *call) { return !call->sent_; });
}

// A response of an unknown request may come before the number of the request is known.
void AwaitedCalls::put(Response response) {
  std::size_t count = 0;
  {
    const redag::LockGuard guard(lock_);
    use_arrival();
    if (Call *const call = give(response)) {
      call->event_.set();
    } else {
      unknown_.push_back(std::move(response));
      count = settle();
    }
  }
  leave_to_callback(count);
}

// None is counted if the response was taken before its arrival was reported.
void AwaitedCalls::use_arrival() { arrived_ -= std::min<std::size_t>(1, arrived_); }

// Sorts the unknown responses once all numbers are known. Returns how many are for the client's callback.
std::size_t AwaitedCalls::settle() {
  if (is_sending()) return 0;
  const std::size_t count = unknown_.size();
  std::move(unknown_.begin(), unknown_.end(), std::back_inserter(set_aside_));
  unknown_.clear();
  set_aside_count_.store(set_aside_.size(), std::memory_order_release);
  return count;
}

void AwaitedCalls::leave_to_callback(std::size_t count) {
  if (count == 0) return;
  std::shared_ptr<ResponseCallback> callback;
  {
    const redag::LockGuard guard(lock_);
    callback = callback_.lock();
  }
  if (callback) callback->leave_to_callback(count);
}

Response AwaitedCalls::take_set_aside() {
  if (set_aside_count_.load(std::memory_order_acquire) == 0) return {};
  const redag::LockGuard guard(lock_);
  if (set_aside_.empty()) return {};
  Response first = std::move(set_aside_.front());
  set_aside_.pop_front();
  set_aside_count_.store(set_aside_.size(), std::memory_order_release);
  return first;
}

bool AwaitedCalls::deliver(const Response &response) {
  if (awaited_.load(std::memory_order_acquire) == 0) return false;
  const redag::LockGuard guard(lock_);
  if (Call *const call = give(response)) {
    call->event_.set();
    return true;
  }
  if (!is_sending()) return false;
  unknown_.push_back(response);
  return true;
}

// ---- a call ----

AwaitedCalls::Call::Call(AwaitedCalls &calls) : calls_(calls) {
  const redag::runtime::RunningJob &running = *redag::runtime::RunningJob::current();
  engine_ = running.engine;
  task_ = running.job.task;
  const redag::LockGuard guard(calls_.lock_);
  calls_.calls_.push_back(this);
  calls_.awaited_.store(calls_.calls_.size(), std::memory_order_release);
}

// Responses that have arrived and were not taken are left to the other callers, or else to the client's callback.
AwaitedCalls::Call::~Call() {
  std::size_t count = 0;
  {
    const redag::LockGuard guard(calls_.lock_);
    std::erase(calls_.calls_, this);
    calls_.awaited_.store(calls_.calls_.size(), std::memory_order_release);
    count = calls_.settle();
    if (calls_.calls_.empty()) count += std::exchange(calls_.arrived_, 0);
    if (calls_.arrived_ > 0) calls_.wake_callers();
  }
  calls_.leave_to_callback(count);
}

void AwaitedCalls::Call::send(rclcpp::ClientBase &client, const void *request) {
  std::int64_t number = 0;
  const rcl_ret_t result = rcl_send_request(client.get_client_handle().get(), request, &number);
  if (result != RCL_RET_OK) rclcpp::exceptions::throw_from_rcl_error(result, "cannot send a request");
  std::size_t count = 0;
  {
    const redag::LockGuard guard(calls_.lock_);
    sent_ = true;
    number_ = number;
    const auto its = std::find_if(calls_.unknown_.begin(), calls_.unknown_.end(),
                                  [&](const Response &response) { return response.id->sequence_number == number; });
    if (its != calls_.unknown_.end()) {
      response_ = its->message;
      calls_.unknown_.erase(its);
      event_.set();
    }
    count = calls_.settle();
  }
  calls_.leave_to_callback(count);
}

// All clients of a service receive its responses. An attempt of rmw_fastrtps takes nothing if the first response is to
// another client, and drops it; that of this call can be behind it. Each such attempt uses up an arrival.
std::shared_ptr<void> AwaitedCalls::Call::take(rclcpp::ClientBase &client) {
  const redag::LockGuard one_at_a_time(calls_.taking_);
  for (;;) {
    std::size_t arrived = 0;
    {
      const redag::LockGuard guard(calls_.lock_);
      if (response_) return std::move(response_);
      arrived = calls_.arrived_;
    }
    Response response{client.create_request_header(), client.create_response()};
    const bool taken = take_and_handle(
        "a response of service", client.get_service_name(),
        [&] { return client.take_type_erased_response(response.message.get(), *response.id); },
        [&] { calls_.put(std::move(response)); });
    if (taken) continue;
    const redag::LockGuard guard(calls_.lock_);
    if (response_) return std::move(response_);
    if (arrived == 0) return nullptr;
    calls_.use_arrival();
  }
}

}  // namespace redag_rclcpp
