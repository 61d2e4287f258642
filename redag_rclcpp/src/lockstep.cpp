// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "lockstep.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <thread>
#include <utility>

#include "rclcpp/logging.hpp"
#include "redag/base/text.hpp"

namespace redag_rclcpp {

using redag::kNever;
using redag::kSecond;

namespace {

constexpr Duration kPatience = 10 * kSecond;      // with messages that the player has published
constexpr Duration kSignOfLife = kSecond;         // between reports while an instant lasts
constexpr Duration kLookForPlayer = 5 * kSecond;  // after the start: until the warning that there is no player

rclcpp::Logger logger() { return rclcpp::get_logger("redag_rclcpp.lockstep"); }

/// A name that no other executor has, also in other processes and on other hosts.
std::string unique_name() {
  static std::atomic<int> count{0};
  std::array<char, 256> host{};
  if (gethostname(host.data(), host.size() - 1) != 0) host[0] = '?';
  return fmt::format("{}.{}.{}", host.data(), getpid(), count.fetch_add(1));
}

// FNV-1a, 64 bits.
std::uint64_t hash(std::uint64_t state, std::string_view text) {
  for (const char c : text) state = (state ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return state;
}
constexpr std::uint64_t kHashOfNothing = 0xcbf29ce484222325ULL;

}  // namespace

Lockstep::Lockstep(rclcpp::Context::SharedPtr context, Time origin, Parts parts)
    : context_(std::move(context)),
      origin_(origin),
      parts_(std::move(parts)),
      clocks_(context_),
      name_(unique_name()) {}

Lockstep::~Lockstep() { close(); }

void Lockstep::open() {
  // The node stays out of what the user sees and sets.
  auto options = rclcpp::NodeOptions()
                     .context(context_)
                     .use_global_arguments(false)
                     .start_parameter_services(false)
                     .start_parameter_event_publisher(false)
                     .enable_rosout(false);
  std::string name = "redag_lockstep_" + name_;
  for (char &c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  node_ = std::make_shared<rclcpp::Node>(name, options);
  reports_ = node_->create_publisher<std_msgs::msg::String>(lockstep::kReportTopic, lockstep::qos());
  orders_ = node_->create_subscription<std_msgs::msg::String>(lockstep::kOrderTopic, lockstep::qos(),
                                                              [](const std_msgs::msg::String &) {});
  orders_->set_on_new_message_callback([wake = parts_.wake](std::size_t) { wake(); });
  set_state(State::Free);
  next_look_ = since_ + kLookForPlayer;
  RCLCPP_INFO(logger(),
              "lockstep: callbacks run one at a time, with one worker and without preemption, learning and "
              "budgets; waiting for a player");
}

void Lockstep::close() {
  if (!node_) return;
  if (state_ != State::Free) {
    report(Report::Kind::Failed, "the executor was stopped");
    end("the executor was stopped");
  }
  orders_->clear_on_new_message_callback();
  orders_.reset();
  reports_.reset();
  node_.reset();
}

void Lockstep::set_state(State state) {
  state_ = state;
  follows_ = state != State::Free;
  running_ = state == State::Running;
  since_ = told_ = parts_.engine.now();
}

// ---- orders ----

void Lockstep::look() {
  take_orders();
  // A player that was killed says no end.
  if ((state_ == State::Connecting || state_ == State::Between) && orders_->get_publisher_count() == 0) {
    end("the player has gone");
  }
  if (follows_) refresh();
  if (state_ == State::Gathering && missing().empty()) start_instant();
  if (state_ == State::Running && quiet_) end_instant();
  warn_without_player();

  const Time now = parts_.engine.now();
  next_look_ = kNever;
  switch (state_) {
    case State::Free:
      if (!warned_free_) next_look_ = since_ + kLookForPlayer;
      break;
    case State::Connecting:
    case State::Between: next_look_ = now + kSignOfLife; break;
    case State::Gathering:
      if (now - since_ >= kPatience) return fail(missing());
      next_look_ = told_ + kSignOfLife;
      if (now >= next_look_) report(Report::Kind::Busy, missing());
      next_look_ = told_ + kSignOfLife;
      break;
    case State::Running:
      if (now >= told_ + kSignOfLife) {
        std::string names;
        for (const redag::runtime::Job &job : parts_.engine.started()) {
          names += (names.empty() ? "" : ", ") + parts_.name_of(job.task);
        }
        report(Report::Kind::Busy, fmt::format("executing {} for {}", names, redag::humanize_duration(now - since_)));
      }
      next_look_ = told_ + kSignOfLife;
      break;
  }
}

void Lockstep::take_orders() {
  std_msgs::msg::String message;
  rclcpp::MessageInfo info;
  while (orders_ && orders_->take(message, info)) {
    if (const redag::Result<Order> order = lockstep::parse_order(message.data)) {
      obey(*order);
    } else {
      RCLCPP_ERROR(logger(), "%s", to_string(order.error()).c_str());
    }
  }
}

void Lockstep::obey(const Order &order) {
  if (order.kind == Order::Kind::Begin) return begin(order);
  // An executor that came later than the player's begin does not know what was published before.
  if (state_ == State::Free || order.session != order_.session) {
    if (order.kind == Order::Kind::Instant && !warned_free_) {
      warned_free_ = true;
      RCLCPP_ERROR(logger(),
                   "a replay in lockstep is in progress that began without this executor, which therefore runs its "
                   "callbacks as messages come. Start all executors before the player, and state their number: "
                   "--executors N");
    }
    return;
  }
  if (order.kind == Order::Kind::End) return end("the player has ended");
  if (order.instant != order_.instant + 1 || state_ != State::Between) {
    const std::uint64_t last = std::exchange(order_.instant, order.instant);
    return fail(fmt::format("it was announced when {} was the last, {}", last,
                            state_ == State::Between ? "and those in between are missing" : "which has not ended"));
  }
  order_ = order;
  for (const auto &[topic, number] : order.published) published_[topic] = number;
  set_state(State::Gathering);
}

void Lockstep::begin(const Order &order) {
  if (order.session != order_.session || state_ == State::Free) {
    if (state_ != State::Free) end("another player has begun");
    order_ = order;
    published_ = order.published;
    seen_change_ = ~std::uint64_t{0};
    jobs_ = 0;
    hash_ = kHashOfNothing;
    said_.clear();
    {
      const redag::LockGuard guard(outside_lock_);
      outside_.clear();
    }
    set_state(State::Connecting);
    RCLCPP_INFO(logger(), "following player %s", order.player.c_str());
  }
  if (state_ != State::Connecting && state_ != State::Between) return;
  clocks_held_ = false;  // a node may use simulated time only now
  refresh();
  const std::string lacking = unconnected();
  if (lacking.empty()) {
    connected_ = true;
    // What has arrived until now, was for instance the end of an earlier player's publishers.
    if (state_ == State::Connecting) {
      for (const auto &callback : paced_) callback->pace(true, 0);
    }
    set_state(State::Between);
  }
  report(lacking.empty() ? Report::Kind::Ready : Report::Kind::Connecting, lacking);
}

void Lockstep::end(const char *why) {
  set_state(State::Free);
  clocks_.release();
  for (const auto &callback : paced_) callback->pace(false, 0);
  paced_.clear();
  callbacks_.clear();
  const redag::LockGuard guard(outside_lock_);
  RCLCPP_INFO(logger(), "%s after %lu instants and %lu callbacks; hash of their order %016lx%s", why, order_.instant,
              jobs_.load(), hash_.load(),
              outside_.empty() ? "" : "; a repetition can differ, because something came from outside the recording");
  warned_free_ = false;
}

// Learns of callbacks that have come and gone.
void Lockstep::refresh() {
  const std::uint64_t change = parts_.registry.changes();
  if (change == seen_change_ && clocks_held_) return;
  clocks_held_ = clocks_.hold(parts_.registry.nodes());
  if (change == seen_change_) return;
  seen_change_ = change;
  connected_ = false;
  callbacks_ = parts_.registry.callbacks();
  paced_.clear();
  for (const auto &callback : callbacks_) {
    if (callback->id().kind != redag::Callback::Kind::Subscription) continue;
    if (callback->id().name == "/clock") came_from_outside(*callback);  // of a node with use_clock_thread(false)
    const auto published = published_.find(callback->id().name);
    if (published == published_.end()) continue;
    if (!callback->paced()) callback->pace(true, published->second);
    paced_.push_back(callback);
  }
}

// What an executor that is to follow still lacks; "": nothing.
std::string Lockstep::unconnected() const {
  if (!clocks_held_) return "a thread of rclcpp is about to set a node's clock";
  for (const auto &callback : paced_) {
    const std::optional<Callback::Paced> paced = callback->paced();
    if (!paced || !callback->alive()) continue;
    const std::string &topic = callback->id().name;
    if (!paced->countable) {
      return fmt::format(
          "{} has a hook of the user's (set_on_new_message_callback()), and its messages cannot be counted: remove the "
          "hook, or do not play {}",
          to_string(callback->id()), topic);
    }
    const auto known = node_->get_publishers_info_by_topic(topic);
    const auto players =
        std::count_if(known.begin(), known.end(), [&](const auto &one) { return one.node_name() == order_.player; });
    if (players != 1 || paced->publishers < known.size()) {
      return fmt::format(
          "{} is connected to {} of {} publishers, {} of them players (if this stays, their QoS is not "
          "compatible, or there is another player)",
          to_string(callback->id()), paced->publishers, known.size(), players);
    }
  }
  return {};
}

// ---- instants ----

// What the player has published and has not arrived; "": nothing.
std::string Lockstep::missing() const {
  for (const auto &callback : paced_) {
    const auto published = order_.published.find(callback->id().name);
    if (published == order_.published.end()) continue;
    const std::optional<Callback::Paced> paced = callback->paced();
    if (!paced || paced->arrived >= published->second || !callback->alive()) continue;
    return fmt::format("{}: {} of {} messages have arrived{}", to_string(callback->id()), paced->arrived,
                       published->second,
                       paced->best_effort ? "; the subscription is best effort, and messages can be lost: make it "
                                            "reliable"
                                          : "");
  }
  return {};
}

void Lockstep::start_instant() {
  for (const auto &callback : paced_) {
    const std::optional<Callback::Paced> paced = callback->paced();
    if (paced && paced->arrived > published_.at(callback->id().name)) came_from_outside(*callback);
  }
  turn_ = std::max(parts_.engine.now(), turn_ + 1);
  set_state(State::Running);
  quiet_ = false;
  parts_.engine.pause();
  clocks_.set(order_.time);
  parts_.registry.while_unchanged([this] {
    for (const auto &callback : callbacks_) callback->begin_instant(++turn_);
  });
  parts_.engine.resume();
}

void Lockstep::wait(Time until) {
  until = std::min(until, parts_.engine.now() + kSignOfLife);
  quiet_ = parts_.engine.wait_quiet(origin_ + until);
}

// Entities that the jobs have made become callbacks now. What has arrived for them is a part of the instant.
void Lockstep::end_instant() {
  if (parts_.registry.is_stale()) {
    parts_.registry.collect();
    refresh();
    quiet_ = false;
    return;
  }
  if (const std::string lacking = connected_ ? std::string() : unconnected(); !lacking.empty()) {
    if (parts_.engine.now() - since_ >= kPatience) return fail(lacking);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // until the middleware has found the player
    quiet_ = false;
    return;
  }
  connected_ = true;
  set_state(State::Between);
  report(Report::Kind::Done);
}

// What one job publishes has one turn: the order in which the middleware hands it to several callbacks plays no part.
Time Lockstep::turn() const {
  return running_.load(std::memory_order_relaxed) ? turn_.load() : std::max(parts_.engine.now(), turn_.load());
}

void Lockstep::ran(const Callback &callback) {
  if (!running_.load(std::memory_order_relaxed)) return;
  if (is_ros_internal(callback.id())) return;
  ++turn_;
  jobs_.fetch_add(1, std::memory_order_relaxed);
  hash_.store(hash(hash_.load(std::memory_order_relaxed), to_string(callback.id())), std::memory_order_relaxed);
}

// ---- reports ----

void Lockstep::came_from_outside(const Callback &callback) {
  const redag::LockGuard guard(outside_lock_);
  if (!follows_) {
    if (came_free_.exchange(true)) return;
    first_free_ = to_string(callback.id());
    return parts_.wake();
  }
  ++outside_[to_string(callback.id())];
}

void Lockstep::warn_without_player() {
  if (state_ != State::Free || warned_free_) return;
  const bool alone = parts_.engine.now() - since_ >= kLookForPlayer;
  if (!came_free_ && !alone) return;
  warned_free_ = true;
  std::string why = "none has come within 5 s";
  if (came_free_) {
    const redag::LockGuard guard(outside_lock_);
    why = fmt::format("{} is to run", first_free_);
  }
  RCLCPP_WARN(logger(),
              "lockstep without a player: %s. Callbacks run as messages and /clock come, and their order is not "
              "reproducible. Play the recording with: ros2 run redag_rclcpp_lab play_lockstep BAG",
              why.c_str());
}

void Lockstep::report(Report::Kind kind, std::string text) {
  told_ = parts_.engine.now();
  Report report;
  report.kind = kind;
  report.session = order_.session;
  report.executor = name_;
  report.instant = order_.instant;
  report.jobs = jobs_;
  report.order = hash_;
  report.text = std::move(text);
  {
    const redag::LockGuard guard(outside_lock_);
    report.outside = outside_;
  }
  for (const auto &callback : paced_) ++report.subscriptions[callback->id().name];
  const bool is_news = !report.text.empty() && report.text != said_ && kind != Report::Kind::Busy;
  if (is_news) {
    said_ = report.text;
    RCLCPP_INFO(logger(), "%s", said_.c_str());
  }
  std_msgs::msg::String message;
  message.data = to_text(report);
  reports_->publish(message);
}

void Lockstep::fail(const std::string &text) {
  RCLCPP_ERROR(logger(), "instant %lu cannot be handled: %s", order_.instant, text.c_str());
  report(Report::Kind::Failed, text);
  end("the replay has failed");
}

}  // namespace redag_rclcpp
