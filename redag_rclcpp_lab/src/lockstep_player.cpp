// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "lockstep_player.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/runtime/clock.hpp"

namespace redag_rclcpp::lab {

using lockstep::Order;
using redag::Duration;
using redag::kMillisecond;
using redag::kSecond;
using redag::Result;
using redag::Time;
using redag::runtime::monotonic_now;

namespace {

constexpr std::chrono::milliseconds kAskAgain(100);     // between orders to begin
constexpr Duration kTellAgain = 5 * kSecond;            // between remarks that executors are awaited
constexpr std::chrono::milliseconds kLongestWait(100);  // for anything, between looks at PlayOptions::stop

std::string package_of(const std::string &type) { return type.substr(0, type.find('/')); }

}  // namespace

LockstepPlayer::LockstepPlayer(rclcpp::Node::SharedPtr node, PlayOptions options,
                               std::function<void(Time, const PlayResult &)> on_instant)
    : node_(std::move(node)),
      options_(std::move(options)),
      on_instant_(std::move(on_instant)),
      spinner_([this] {
        rclcpp::ExecutorOptions of_node;
        of_node.context = node_->get_node_base_interface()->get_context();
        return of_node;
      }()),
      random_(options_.shuffle),
      paused_(options_.paused) {
  orders_ = node_->create_publisher<std_msgs::msg::String>(lockstep::kOrderTopic, lockstep::qos());
  reports_ = node_->create_subscription<std_msgs::msg::String>(
      lockstep::kReportTopic, lockstep::qos(), [this](const std_msgs::msg::String &message) { hear(message.data); });
  clock_ = node_->create_publisher<rosgraph_msgs::msg::Clock>("/clock", rclcpp::ClockQoS());
  pause_ = node_->create_service<std_srvs::srv::SetBool>(
      "~/pause", [this](const std::shared_ptr<std_srvs::srv::SetBool::Request> request,
                        const std::shared_ptr<std_srvs::srv::SetBool::Response> response) {
        paused_ = request->data;
        response->success = true;
      });
  spinner_.add_node(node_);
  order_.session = fmt::format("{}.{}", getpid(), monotonic_now());
  order_.player = node_->get_name();
}

LockstepPlayer::~LockstepPlayer() { spinner_.remove_node(node_); }

Result<PlayResult> LockstepPlayer::play(Recording &recording) {
  Result<void> done = advertise(recording);
  if (done) done = connect();
  for (std::uint32_t i = 0; done && !result_.stopped && i < options_.repeat; ++i) {
    if (i > 0) done = recording.rewind();
    if (!done) is_recording_bad_ = true;
    if (done) done = play_once(recording);
  }
  if (rclcpp::ok(node_->get_node_base_interface()->get_context())) {
    announce(Order::Kind::End);
    (void)orders_->wait_for_all_acked(std::chrono::seconds(1));
  }
  if (!done) return tl::unexpected(done.error());
  return result_;
}

Result<void> LockstepPlayer::advertise(const Recording &recording) {
  for (const RecordedTopic &topic : recording.topics()) {
    rclcpp::QoS qos(rclcpp::KeepLast(1000));
    qos.reliable();
    if (topic.latched) qos.transient_local();
    try {
      topics_.push_back({topic.name, node_->create_generic_publisher(topic.name, topic.type, qos)});
    } catch (const std::exception &error) {
      is_recording_bad_ = true;
      return redag::make_error(fmt::format("cannot publish '{}' of type {}: {}", topic.name, topic.type, error.what()),
                               fmt::format("source the workspace with the package {}, or leave the topic out with "
                                           "--topics",
                                           package_of(topic.type)));
    }
    order_.published[topic.name] = 0;
  }
  return {};
}

// ---- executors ----

void LockstepPlayer::hear(const std::string &text) {
  Result<Report> report = lockstep::parse_report(text);
  if (!report) return options_.say(to_string(report.error()));
  if (report->session != order_.session) return;
  if (complete_ && result_.executors.count(report->executor) == 0) return;
  Follower &follower = result_.executors[report->executor];
  follower = {*std::move(report), monotonic_now()};
}

// Waits until all executors are ready, and connected in both directions.
Result<void> LockstepPlayer::connect() {
  if (options_.executors == 0) {
    const Time until = monotonic_now() + kSecond;  // subscriptions appear
    while (!options_.stop() && monotonic_now() < until) spinner_.spin_once(kLongestWait);
    return {};
  }
  Time say_at = monotonic_now() + kSecond;
  Time ready_at = redag::kNever;  // since when enough executors are
  for (;;) {
    if (options_.stop()) {
      result_.stopped = true;
      return {};
    }
    announce(Order::Kind::Begin);
    std::uint32_t ready = 0;
    const Time until = monotonic_now() + std::chrono::nanoseconds(kAskAgain).count();
    for (Time now = monotonic_now(); now < until; now = monotonic_now()) {
      spinner_.spin_once(std::chrono::nanoseconds(until - now));
      ready = 0;
      for (const auto &[name, follower] : result_.executors) ready += follower.report.kind == Report::Kind::Ready;
      if (ready >= options_.executors && unmatched().empty()) break;
    }
    if (result_.executors.size() > options_.executors) {
      return redag::make_error(fmt::format("{} executors are in lockstep, and --executors says {}",
                                           result_.executors.size(), options_.executors),
                               "state their number, or stop those that do not belong to the replay");
    }
    for (const auto &[name, follower] : result_.executors) {
      if (follower.report.kind != Report::Kind::Failed) continue;
      return redag::make_error(fmt::format("executor {}: {}", name, follower.report.text));
    }
    std::string lacks = fmt::format("{} of {} executors are ready", ready, options_.executors);
    for (const auto &[name, follower] : result_.executors) {
      if (!follower.report.text.empty()) lacks += fmt::format("; {}: {}", name, follower.report.text);
    }
    if (ready == options_.executors) {
      lacks = unmatched();
      ready_at = std::min(ready_at, monotonic_now());
      // Others that listen may be executors that have not answered yet.
      const bool has_more = orders_->get_subscription_count() > options_.executors;
      if (lacks.empty() && (!has_more || monotonic_now() - ready_at >= kSecond)) break;
    }
    if (monotonic_now() >= say_at) {
      options_.say(fmt::format("waiting: {}", lacks));
      say_at = monotonic_now() + kTellAgain;
    }
  }
  complete_ = true;
  order_.published.clear();
  return {};
}

// A topic that not all subscriptions of the executors have yet, in words; "": there is none.
std::string LockstepPlayer::unmatched() const {
  std::map<std::string, std::uint64_t> wanted;
  for (const auto &[name, follower] : result_.executors) {
    for (const auto &[topic, number] : follower.report.subscriptions) wanted[topic] += number;
  }
  for (const Topic &topic : topics_) {
    const auto number = wanted.find(topic.name);
    if (number == wanted.end() || topic.publisher->get_subscription_count() >= number->second) continue;
    return fmt::format("{} of {} subscriptions of '{}' are connected (if this stays, their QoS is not compatible)",
                       topic.publisher->get_subscription_count(), number->second, topic.name);
  }
  return {};
}

void LockstepPlayer::announce(Order::Kind kind) {
  order_.kind = kind;
  std_msgs::msg::String message;
  message.data = to_text(order_);
  orders_->publish(message);
}

// ---- instants ----

Result<bool> LockstepPlayer::read(Recording &recording, RecordedMessage &message) {
  Result<bool> has_one = recording.next(message);
  if (!has_one) is_recording_bad_ = true;
  return has_one;
}

// An instant for each time of a message, and for each tick.
Result<void> LockstepPlayer::play_once(Recording &recording) {
  RecordedMessage next;
  Result<bool> has_next = read(recording, next);
  if (!has_next) return tl::unexpected(has_next.error());
  if (!*has_next) {
    is_recording_bad_ = true;
    return redag::make_error("the recording has no messages");
  }
  first_ = next.time;
  begun_ = redag::kNever;
  const Time began = monotonic_now();
  Time last = first_;
  std::vector<RecordedMessage> messages;
  for (Time tick = first_; *has_next;) {
    const Time time = std::min(tick, next.time);
    messages.clear();
    while (*has_next && next.time == time) {
      messages.push_back(std::move(next));
      next = RecordedMessage();
      has_next = read(recording, next);
      if (!has_next) return tl::unexpected(has_next.error());
    }
    if (time == tick) tick += options_.tick;
    if (!pace(time)) break;
    if (Result<void> done = step(time, messages); !done) return done;
    last = time;
  }
  result_.recorded += last - first_;
  result_.took += monotonic_now() - (begun_ == redag::kNever ? began : begun_);
  return {};
}

// Waits until the instant is due. False: the player is to stop.
bool LockstepPlayer::pace(Time time) {
  for (;;) {
    if (options_.stop()) {
      result_.stopped = true;
      return false;
    }
    const Time now = monotonic_now();
    if (begun_ == redag::kNever) begun_ = now;
    if (paused_) {
      spinner_.spin_once(kLongestWait);
      begun_ += monotonic_now() - now;
      continue;
    }
    if (options_.rate == 0) return true;
    const Time due = begun_ + static_cast<Duration>(static_cast<double>(time - first_) / options_.rate);
    if (now >= due) return true;
    spinner_.spin_once(std::min<std::chrono::nanoseconds>(kLongestWait, std::chrono::nanoseconds(due - now)));
  }
}

Result<void> LockstepPlayer::step(Time time, std::vector<RecordedMessage> &messages) {
  ++order_.instant;
  order_.time = time;
  order_.published.clear();
  for (const RecordedMessage &message : messages) {
    Topic &topic = topics_[message.topic];
    order_.published[topic.name] = ++topic.published;
  }
  publish_in_order(time, messages);
  ++result_.instants;
  result_.messages += messages.size();
  if (Result<void> done = await_end_of_instant(); !done) return done;
  if (on_instant_) on_instant_(time, result_);
  return {};
}

// The messages of one topic keep their order.
void LockstepPlayer::publish_in_order(Time time, std::vector<RecordedMessage> &messages) {
  std::vector<std::size_t> parts;  // the topics of the messages, /clock, and the announcement
  for (const RecordedMessage &message : messages) parts.push_back(message.topic);
  const std::size_t clock = topics_.size();
  const std::size_t announcement = clock + 1;
  parts.push_back(clock);
  parts.push_back(announcement);
  if (options_.shuffle != 0) {
    for (std::size_t i = parts.size(); i > 1; --i) {
      const std::int64_t other = random_.uniform(0, static_cast<std::int64_t>(i) - 1);
      std::swap(parts[i - 1], parts[static_cast<std::size_t>(other)]);
    }
  }
  std::vector<bool> published(messages.size(), false);
  for (const std::size_t part : parts) {
    if (options_.shuffle != 0) std::this_thread::sleep_for(std::chrono::microseconds(random_.uniform(0, 1000)));
    if (part == clock) {
      rosgraph_msgs::msg::Clock message;
      message.clock = rclcpp::Time(time, RCL_ROS_TIME);
      clock_->publish(message);
    } else if (part == announcement) {
      announce(Order::Kind::Instant);
    } else {
      std::size_t i = 0;
      while (published[i] || messages[i].topic != part) ++i;
      published[i] = true;
      topics_[part].publisher->publish(messages[i].data);
    }
  }
}

Result<void> LockstepPlayer::await_end_of_instant() {
  for (auto &[name, follower] : result_.executors) follower.heard = monotonic_now();
  for (;;) {
    std::uint32_t done = 0;
    if (Result<void> well = check(done); !well) return well;
    // A callback may have made a subscription, which is to have the next message.
    if (done == result_.executors.size() && unmatched().empty()) return {};
    if (options_.stop()) {
      result_.stopped = true;
      return {};
    }
    spinner_.spin_once(kLongestWait);
  }
}

Result<void> LockstepPlayer::check(std::uint32_t &done) {
  const Time now = monotonic_now();
  for (const auto &[name, follower] : result_.executors) {
    const Report &report = follower.report;
    if (report.kind == Report::Kind::Failed) {
      return redag::make_error(
          fmt::format("executor {} has failed at instant {}: {}", name, report.instant, report.text));
    }
    const bool is_done = report.kind == Report::Kind::Done && report.instant == order_.instant;
    if (is_done) ++done;
    if (now - follower.heard < options_.patience) continue;
    if (is_done) return redag::make_error(unmatched());
    return redag::make_error(fmt::format("executor {} has given no sign of life for {} in instant {}", name,
                                         redag::humanize_duration(options_.patience), order_.instant),
                             "its process has ended or stands still; executors that compute report each second");
  }
  return {};
}

}  // namespace redag_rclcpp::lab
