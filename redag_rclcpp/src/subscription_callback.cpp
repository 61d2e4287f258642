// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callbacks as jobs: takes what arrived and calls the user's function.
#include <rcl/wait.h>

#include <utility>

#include "callback.hpp"
#include "compat.hpp"
#include "rclcpp/executor.hpp"
#include "rclcpp/logging.hpp"
#include "redag/runtime/running_job.hpp"

namespace redag_rclcpp {

using redag::sched::Outcome;

namespace {

// Opens rclcpp's own way of executing a subscription, for the cases that need no other.
struct Rclcpp : rclcpp::Executor {
  using rclcpp::Executor::execute_subscription;
};

/// Takes with `take`, then calls `handle`. False: there was nothing to take. Logs a failed take, as rclcpp's executors
/// do.
template <class Take, class Handle>
bool take_and_handle(const char *what, const char *name, Take take, Handle handle) {
  bool taken = false;
  try {
    taken = take();
  } catch (const rclcpp::exceptions::RCLError &error) {
    RCLCPP_ERROR(rclcpp::get_logger("redag_rclcpp"), "taking %s '%s' failed: %s", what, name, error.what());
  }
  if (taken) handle();
  return taken;
}

}  // namespace

// Taking guards the message that a started job is about to take. The middleware keeps this message until begin() and
// may overwrite it; the job then takes the newer one. begin() is called as late as possible, because creating the
// message to take into can take long.
class Callback::Taking {
 public:
  Taking(Callback &callback, Source source) : callback_(callback), source_(source) {}
  ~Taking() {
    if (begun_) return;
    begin();
    const redag::LockGuard guard(callback_.lock_);
    callback_.leftovers_[index_of(source_)] = true;  // the message may still be there
  }
  Taking(const Taking &) = delete;
  Taking &operator=(const Taking &) = delete;

  void begin() {
    begun_ = true;
    const redag::LockGuard guard(callback_.lock_);
    --callback_.kept_[index_of(source_)];
  }

  void count(bool taken) {
    const redag::LockGuard guard(callback_.lock_);
    ++callback_.takes_;
    if (taken) ++callback_.taken_;
  }

 private:
  Callback &callback_;
  const Source source_;
  bool begun_ = false;
};

Outcome Callback::execute(const redag::runtime::Job &job) {
  Token token;
  bool executed = false;
  if (is_timer()) {
    executed = execute_timer();
  } else if (take_token(token)) {
    executed = execute_token(token);
  }
  if (!executed) return Outcome::NoData;
  const Duration response = engine_.now() - job.release;
  response_.add(response);
  if (response > deadline_.load(std::memory_order_relaxed)) late_.fetch_add(1, std::memory_order_relaxed);
  execution_.add(redag::runtime::RunningJob::current()->close());
  return Outcome::Finished;
}

bool Callback::execute_token(const Token &token) {
  // Tells the wait set that its arrival was handled, also if an exception leaves this function.
  struct Watch {
    ~Watch() {
      if (!token.seen_only) return;
      std::shared_ptr<ExecutorContext> intake;
      {
        const redag::LockGuard guard(self.lock_);
        self.seen_ = false;
        intake = self.intake_;
      }
      if (intake) intake->wait_set_changed();
    }
    Callback &self;
    const Token &token;
  } watch{*this, token};

  Taking taking(*this, token.source);
  if (token.after_skipped) drop_messages(token.source);
  const bool taken = execute_arrival(token, taking);
  bool more = false;
  {
    const redag::LockGuard guard(lock_);
    bool &leftovers = leftovers_[index_of(token.source)];
    leftovers = leftovers && taken;
    more = leftovers && kept_[index_of(token.source)] == 0;
  }
  if (more) arrived(1, token.source, 0);
  return taken;
}

bool Callback::execute_arrival(const Token &token, Taking &taking) {
  if (token.source == Source::IntraProcess) {
    taking.begin();
    const auto waitable = intra_process_.lock();
    // Taking from an empty buffer is not allowed.
    rcl_wait_set_t unused = rcl_get_zero_initialized_wait_set();
    return waitable && compat::is_ready(*waitable, unused) && execute_waitable(*waitable, token);
  }
  if (const auto subscription = subscription_.lock()) return execute_subscription(*subscription, taking);
  taking.begin();
  if (const auto waitable = waitable_.lock()) return execute_waitable(*waitable, token);
  return execute_service() || execute_client();
}

bool Callback::execute_waitable(rclcpp::Waitable &waitable, const Token &token) {
  std::shared_ptr<void> data =
      token.seen_only ? waitable.take_data() : waitable.take_data_by_entity_id(static_cast<std::size_t>(token.part));
  compat::execute(waitable, data);
  return true;
}

// Drops the messages whose jobs were skipped.
void Callback::drop_messages(Source source) {
  const auto subscription = subscription_.lock();
  if (!subscription) return;
  if (source == Source::IntraProcess) {
    const auto intra_process = intra_process_.lock();
    rcl_wait_set_t unused = rcl_get_zero_initialized_wait_set();
    return drop_messages(source, [&] {
      return intra_process && compat::is_ready(*intra_process, unused) && intra_process->take_data() != nullptr;
    });
  }
  const auto drop = [&](auto take) {
    const auto dropped = [] {};
    drop_messages(source,
                  [&] { return take_and_handle("a message of topic", subscription->get_topic_name(), take, dropped); });
  };
  rclcpp::MessageInfo info;
  if (subscription->is_serialized()) {
    auto message = subscription->create_serialized_message();
    drop([&] { return subscription->take_serialized(*message, info); });
    subscription->return_serialized_message(message);
  } else {
    std::shared_ptr<void> message = subscription->create_message();
    drop([&] { return subscription->take_type_erased(message.get(), info); });
    subscription->return_message(message);
  }
}

// `take` takes one message; false: there is none. Some of the messages to drop may have been overwritten meanwhile.
template <class Take>
void Callback::drop_messages(Source source, Take take) {
  const std::size_t at = index_of(source);
  for (bool taken = true; taken; taken = take()) {
    const redag::LockGuard guard(lock_);
    if (dropping_[at] == 0) return;
    --dropping_[at];
    --kept_[at];
  }
  const redag::LockGuard guard(lock_);  // the remaining messages are gone as well
  kept_[at] -= std::exchange(dropping_[at], 0);
}

bool Callback::execute_subscription(rclcpp::SubscriptionBase &subscription, Taking &taking) {
  TRACETOOLS_TRACEPOINT(rclcpp_executor_execute,
                        static_cast<const void *>(subscription.get_subscription_handle().get()));
  if (subscription.is_serialized() || subscription.can_loan_messages()) {
    taking.begin();
    Rclcpp::execute_subscription(subscription.shared_from_this());
    return true;
  }
  rclcpp::MessageInfo info;
  info.get_rmw_message_info().from_intra_process = false;
  std::shared_ptr<void> message = subscription.create_message();
  taking.begin();
  const bool taken = take_and_handle(
      "a message of topic", subscription.get_topic_name(),
      [&] { return subscription.take_type_erased(message.get(), info); },
      [&] { subscription.handle_message(message, info); });
  if (has_intra_process_) taking.count(taken);
  subscription.return_message(message);
  return taken;
}

bool Callback::execute_service() {
  const auto service = service_.lock();
  if (!service) return false;
  auto header = service->create_request_header();
  std::shared_ptr<void> request = service->create_request();
  return take_and_handle(
      "a request of service", service->get_service_name(),
      [&] { return service->take_type_erased_request(request.get(), *header); },
      [&] { service->handle_request(header, request); });
}

bool Callback::execute_client() {
  const auto client = client_.lock();
  if (!client) return false;
  auto header = client->create_request_header();
  std::shared_ptr<void> response = client->create_response();
  return take_and_handle(
      "a response of service", client->get_service_name(),
      [&] { return client->take_type_erased_response(response.get(), *header); },
      [&] { client->handle_response(header, response); });
}

}  // namespace redag_rclcpp
