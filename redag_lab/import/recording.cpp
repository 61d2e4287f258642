// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/recording.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace redag::lab {

using Kind = RosEvent::Kind;

namespace {

constexpr Duration kIdle = 200 * kMicrosecond;  // a wait that lasts for longer was for something to be ready

}  // namespace

void Recording::add(const RosEvent &event) {
  if (events_++ == 0) first_ = event.time;
  last_ = std::max(last_, event.time);
  if (event.kind == Kind::Switch) {
    switch_threads(event);
    return;
  }
  ProcessRecord &process = processes_[event.process];
  if (process.program.empty()) process.program = event.program;
  const Key key{event.process, event.handle};
  switch (event.kind) {
    case Kind::NodeInit:
      nodes_[key] = Node();
      nodes_[key].name = std::string(event.space) + (event.space == "/" ? "" : "/") + std::string(event.name);
      break;
    case Kind::PublisherInit: publishers_[key] = event.name; break;
    case Kind::SubscriptionInit:
      make(event, Callback::Kind::Subscription);
      addresses_[{event.process, event.third}] = callbacks_.size() - 1;
      break;
    case Kind::ServiceInit: make(event, Callback::Kind::Service); break;
    case Kind::TimerInit: make(event, Callback::Kind::Timer); break;
    case Kind::SubscriptionObject:
    case Kind::SubscriptionCallback: bind_subscription(event); break;
    case Kind::CallbackAdded: addresses_[{event.process, event.other}] = find(event.process, event.handle); break;
    case Kind::TimerNode: {
      const std::size_t timer = find(event.process, event.handle);
      const auto node = nodes_.find({event.process, event.other});
      if (timer == kUnknown || node == nodes_.end()) break;
      callbacks_[timer].id.node = node->second.name;
      callbacks_[timer].node = event.other;
      callbacks_[timer].id.index = node->second.timers++;
      break;
    }
    case Kind::Start: start(event); break;
    case Kind::End: end(event); break;
    case Kind::Publish:
    case Kind::IntraPublish: publish(event); break;
    case Kind::Take:
    case Kind::Dispatch: {
      Thread &thread = thread_of(event);
      thread.taken_by = event.value > 0 ? find(event.process, event.handle) : kUnknown;
      thread.sent = event.value;
      break;
    }
    case Kind::Group:
      if (event.name == "reentrant") reentrant_.insert(key);
      break;
    case Kind::GroupMember:
      if (const std::size_t member = find(event.process, event.handle); member != kUnknown) {
        callbacks_[member].group = event.other;
      }
      break;
    case Kind::Wait:
    case Kind::Look: look(event); [[fallthrough]];
    case Kind::Executor: process.executor_threads.insert(event.thread); break;
    case Kind::Switch: break;
  }
}

void Recording::make(const RosEvent &event, Callback::Kind kind) {
  addresses_[{event.process, event.handle}] = callbacks_.size();
  CallbackRecord &made = callbacks_.emplace_back();
  made.process = event.process;
  made.id.kind = kind;
  made.id.name = event.name;
  made.created = event.created != 0 ? event.created : event.time;
  if (kind == Callback::Kind::Timer) made.id.period = event.value;
  const auto node = nodes_.find({event.process, event.other});
  if (node == nodes_.end()) return;
  made.id.node = node->second.name;
  made.node = event.other;
}

std::size_t Recording::find(std::uint32_t process, std::uint64_t address) const {
  const auto found = addresses_.find({process, address});
  return found == addresses_.end() ? kUnknown : found->second;
}

// Of the two events in which an object says its subscription and its callback, either comes first.
void Recording::bind_subscription(const RosEvent &event) {
  const std::uint32_t process = event.process;
  if (event.kind == Kind::SubscriptionObject) {
    const std::size_t owner = find(process, event.handle);
    if (const auto callback = unclaimed_.extract({process, event.other})) {
      addresses_[{process, callback.mapped()}] = owner;
    } else {
      unbound_[{process, event.other}] = owner;
    }
  } else if (const auto owner = unbound_.extract({process, event.handle})) {
    addresses_[{process, event.other}] = owner.mapped();
  } else {
    unclaimed_[{process, event.handle}] = event.other;
  }
}

Recording::Thread &Recording::thread_of(const RosEvent &event) {
  Thread &thread = threads_[{event.process, event.thread}];
  thread.left.reset();  // it records an event, so it has a processor
  return thread;
}

void Recording::start(const RosEvent &event) {
  Thread &thread = thread_of(event);
  thread.process = &processes_[event.process];
  thread.process->threads.insert(event.thread);
  thread.process->executor_threads.insert(event.thread);
  of_kernel_[event.thread] = {event.process, event.thread};
  const std::size_t position = find(event.process, event.handle);
  if (position != kUnknown) {
    CallbackRecord &callback = callbacks_[position];
    if (callback.runs++ == 0) callback.first_start = event.time;
    callback.last_start = event.time;
    if (event.value != 0) callback.takes_directly = true;
    if (callback.begun.size() < kMostArrivals) {
      callback.begun.push_back(event.time);
      if (thread.taken_by == position) callback.sent.push_back(thread.sent);
    }
    note_overlaps(thread, position);
  }
  const auto sent = position == kUnknown ? std::nullopt : sent_of(position, thread, event.time);
  thread.taken_by = kUnknown;
  Node *node = position == kUnknown ? nullptr : node_of(position);
  if (node != nullptr) node->threads.insert(&thread);
  const std::optional<Time> free = free_since(thread, node);
  const std::optional<Time> woken = free ? note_turn(thread, position) : std::nullopt;
  if (node != nullptr) ++node->running;
  thread.runs.push_back({event.handle, position, node, event.time, sent, free, woken, thread.absent, 0, {}});
}

std::optional<Time> Recording::free_since(const Thread &thread, const Node *node) {
  if (!thread.runs.empty()) return std::nullopt;  // another callback called it
  if (node == nullptr || node->running > 0) return std::nullopt;
  Time idle = thread.last_end;
  for (const Thread *other : node->threads) {
    if (other->runs.empty()) idle = std::min(idle, other->last_end);
  }
  return std::max(idle, node->last_end);
}

void Recording::look(const RosEvent &event) {
  Thread &thread = thread_of(event);
  Window &window = windows_[event.process];
  if (event.kind == Kind::Wait) {
    ++window.number;
    window.began = event.time;
  } else if (std::exchange(thread.waits, false)) {
    const bool was_idle = event.time - window.began > kIdle;
    window.woken = was_idle ? std::optional(event.time) : std::nullopt;
  }
  thread.waits = event.kind == Kind::Wait;
  thread.look = event.time;
  thread.window = window.number;
}

/// Returns Window::woken of what the callback was taken from.
std::optional<Time> Recording::note_turn(Thread &thread, std::size_t position) {
  if (thread.window == 0) return std::nullopt;
  const CallbackRecord &callback = callbacks_[position];
  Window &last = windows_[callback.process];
  // Of two threads, the one that looked first can begin later.
  if (last.taken_from == thread.window && callbacks_[last.callback].id.kind == callback.id.kind) {
    const bool in_turn = last.look <= thread.look;
    ++turns_[in_turn ? std::pair(last.callback, position) : std::pair(position, last.callback)];
  }
  last.look = thread.look;
  last.callback = position;
  last.taken_from = std::exchange(thread.window, 0);
  return last.taken_from == last.number ? last.woken : std::nullopt;
}

Recording::Node *Recording::node_of(std::size_t callback) {
  const auto node = nodes_.find({callbacks_[callback].process, callbacks_[callback].node});
  return node == nodes_.end() ? nullptr : &node->second;
}

void Recording::leave(const Run &run, Time now) {
  if (run.node == nullptr) return;
  run.node->running -= run.node->running > 0 ? 1 : 0;  // 0 if another node came to its address
  run.node->last_end = now;
}

std::optional<Time> Recording::sent_of(std::size_t position, const Thread &thread, Time start) const {
  const CallbackRecord &callback = callbacks_[position];
  if (callback.id.kind != Callback::Kind::Subscription) return std::nullopt;
  const auto messages = sent_.find(callback.id.name);
  const bool is_stamped = thread.taken_by == position;
  if (messages == sent_.end()) {
    // Of a process that was not recorded: its clock is trusted if it can be this one.
    const bool is_near = is_stamped && thread.sent <= start && start - thread.sent <= kSecond;
    return is_near ? std::optional(thread.sent) : std::nullopt;
  }
  if (!is_stamped) return messages->second.back();
  // The middleware's clock can be another one, and it reads it a little after the event.
  const auto distance = [&](Time time) { return std::abs(time - thread.sent); };
  const Time nearest = *std::min_element(messages->second.begin(), messages->second.end(),
                                         [&](Time a, Time b) { return distance(a) < distance(b); });
  if (distance(nearest) <= kMillisecond) return nearest;
  const bool is_lost = messages->second.back() < thread.sent && thread.sent <= start;  // the event of the message
  return is_lost ? thread.sent : messages->second.back();
}

void Recording::note_overlaps(const Thread &thread, std::size_t position) {
  CallbackRecord &callback = callbacks_[position];
  std::uint32_t at_once = 1;
  for (auto other = threads_.lower_bound({callback.process, 0}); other != threads_.end(); ++other) {
    if (other->first.first != callback.process) break;
    if (&other->second == &thread) continue;
    for (const Run &run : other->second.runs) {
      if (run.callback == position) {
        ++at_once;
      } else if (run.callback != kUnknown && callbacks_[run.callback].id.node == callback.id.node) {
        callback.overlaps.insert(run.callback);
        callbacks_[run.callback].overlaps.insert(position);
      }
    }
  }
  callback.most_at_once = std::max(callback.most_at_once, at_once);
}

void Recording::end(const RosEvent &event) {
  Thread &thread = thread_of(event);
  ProcessRecord &process = processes_[event.process];
  const auto is_it = [&](const Run &run) { return run.handle == event.handle; };
  if (std::none_of(thread.runs.begin(), thread.runs.end(), is_it)) {
    ++process.torn_runs;
    return;
  }
  for (; !is_it(thread.runs.back()); thread.runs.pop_back()) {
    ++process.torn_runs;
    leave(thread.runs.back(), event.time);
  }
  const Run run = std::move(thread.runs.back());
  thread.runs.pop_back();
  thread.last_end = event.time;
  leave(run, event.time);
  const Duration whole = std::max<Duration>(event.time - run.start - (thread.absent - run.absent), 0);
  const Duration own = std::max<Duration>(whole - run.inner, 0);
  if (!thread.runs.empty()) thread.runs.back().inner += whole;
  ++process.runs;
  process.executed += own;
  if (run.callback == kUnknown) {
    ++process.unknown_runs;
    return;
  }
  CallbackRecord &callback = callbacks_[run.callback];
  callback.executed += own;
  (run.sent.empty() ? callback.quiet : callback.publishing).add(own);
  if (callback.ended.size() < kMostRuns) {
    callback.ended.push_back({run.start, event.time, own, run.released, run.free, run.woken, !run.sent.empty()});
  }
  for (const Sent &sent : run.sent) {
    CallbackRecord::Output &output = callback.outputs[*sent.topic];
    ++output.runs;
    output.messages += std::max(sent.directly, sent.by_middleware);
  }
}

void Recording::publish(const RosEvent &event) {
  const auto topic = publishers_.find({event.process, event.handle});
  if (topic == publishers_.end()) return;
  std::deque<Time> &messages = sent_[topic->second];
  messages.push_back(event.time);
  if (messages.size() > kMostMessages) messages.pop_front();
  Thread &thread = thread_of(event);
  if (thread.runs.empty()) {
    sent_elsewhere_.insert(topic->second);
    return;
  }
  std::vector<Sent> &sent = thread.runs.back().sent;
  auto entry = std::find_if(sent.begin(), sent.end(), [&](const Sent &known) { return *known.topic == topic->second; });
  if (entry == sent.end()) entry = sent.insert(entry, Sent{&topic->second, 0, 0});
  ++(event.kind == Kind::Publish ? entry->by_middleware : entry->directly);
}

void Recording::switch_threads(const RosEvent &event) {
  for (const bool comes : {false, true}) {
    const auto key = of_kernel_.find(comes ? event.other : event.handle);
    if (key == of_kernel_.end()) continue;
    Thread &thread = threads_[key->second];
    thread.process->has_switches = true;
    if (comes && thread.left) thread.absent += event.time - *thread.left;
    thread.left = comes ? std::nullopt : std::optional(event.time);
  }
}

}  // namespace redag::lab
