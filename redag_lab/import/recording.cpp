// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/recording.hpp"

#include <algorithm>

namespace redag::lab {
namespace {

using Kind = RosEvent::Kind;

template <class Map, class Key>
std::size_t find_or(const Map &map, const Key &key, std::size_t otherwise) {
  const auto found = map.find(key);
  return found == map.end() ? otherwise : found->second;
}

}  // namespace

std::optional<std::size_t> Recording::find_topic(const std::string &name) const {
  const auto found = topic_names_.find(name);
  return found == topic_names_.end() ? std::nullopt : std::optional(found->second);
}

void Recording::add(const RosEvent &event) {
  if (events_++ == 0) first_ = event.time;
  if (event.time < last_) ++disordered_;
  last_ = std::max(last_, event.time);
  if (event.kind == Kind::Switch) {
    switch_threads(event);
    return;
  }
  if (ProcessRecord &process = processes_[event.process]; process.program.empty()) process.program = event.program;
  const Key key{event.process, event.handle};
  switch (event.kind) {
    case Kind::NodeInit:
      nodes_[key] = Node{std::string(event.space) + (event.space == "/" ? "" : "/") + std::string(event.name), 0};
      break;
    case Kind::PublisherInit: publishers_[key] = topic_of(event.name); break;
    case Kind::SubscriptionInit:
      subscriptions_[key] = make(event, Callback::Kind::Subscription);
      taking_[{event.process, event.third}] = subscriptions_[key];
      break;
    case Kind::SubscriptionObject:
    case Kind::SubscriptionCallback: bind_subscription(event); break;
    case Kind::ServiceInit: services_[key] = make(event, Callback::Kind::Service); break;
    case Kind::ServiceCallback: bind(services_, event); break;
    case Kind::TimerInit: timers_[key] = make(event, Callback::Kind::Timer); break;
    case Kind::TimerCallback: bind(timers_, event); break;
    case Kind::TimerNode: {
      const std::size_t timer = find_or(timers_, key, kUnknown);
      const auto node = nodes_.find({event.process, event.other});
      if (timer == kUnknown || node == nodes_.end()) break;
      callbacks_[timer].id.node = node->second.name;
      callbacks_[timer].id.index = node->second.timers++;
      break;
    }
    case Kind::Start: start(event); break;
    case Kind::End: end(event); break;
    case Kind::Publish:
    case Kind::IntraPublish: publish(event); break;
    case Kind::Take: {
      Thread &thread = thread_of(event);
      thread.taken_by = event.value > 0 ? find_or(taking_, key, kUnknown) : kUnknown;
      thread.sent = event.value;
      break;
    }
    case Kind::Executor: processes_[event.process].executor_threads.insert(event.thread); break;
    case Kind::Switch: break;
  }
}

std::size_t Recording::make(const RosEvent &event, Callback::Kind kind) {
  CallbackRecord &made = callbacks_.emplace_back();
  made.process = event.process;
  made.id.kind = kind;
  made.id.name = event.name;
  made.created = event.time;
  if (kind == Callback::Kind::Timer) made.id.period = event.value;
  const auto node = nodes_.find({event.process, event.other});
  if (node != nodes_.end()) made.id.node = node->second.name;
  return callbacks_.size() - 1;
}

std::size_t Recording::topic_of(std::string_view name) {
  const auto [found, is_new] = topic_names_.try_emplace(std::string(name), topics_.size());
  if (is_new) topics_.push_back({std::string(name), 0});
  return found->second;
}

void Recording::bind(const std::map<Key, std::size_t> &owners, const RosEvent &event) {
  const std::size_t owner = find_or(owners, Key{event.process, event.handle}, kUnknown);
  if (owner != kUnknown) handles_[{event.process, event.other}] = owner;
}

// Of the two events in which an object says its subscription and its callback, either comes first.
void Recording::bind_subscription(const RosEvent &event) {
  if (event.kind == Kind::SubscriptionObject) {
    const std::size_t owner = find_or(subscriptions_, Key{event.process, event.handle}, kUnknown);
    const auto callback = unclaimed_.extract({event.process, event.other});
    if (callback) {
      handles_[{event.process, callback.mapped()}] = owner;
    } else {
      objects_[{event.process, event.other}] = owner;
    }
    return;
  }
  const auto owner = objects_.extract({event.process, event.handle});
  if (owner) {
    handles_[{event.process, event.other}] = owner.mapped();
  } else {
    unclaimed_[{event.process, event.handle}] = event.other;
  }
}

Recording::Thread &Recording::thread_of(const RosEvent &event) {
  Thread &thread = threads_[{event.process, event.thread}];
  // It records an event: it has a processor.
  thread.left.reset();
  return thread;
}

void Recording::start(const RosEvent &event) {
  Thread &thread = thread_of(event);
  ProcessRecord &process = processes_[event.process];
  thread.process = &process;
  process.threads.insert(event.thread);
  process.executor_threads.insert(event.thread);
  of_kernel_[event.thread] = {event.process, event.thread};
  Run run{
      event.handle, find_or(handles_, Key{event.process, event.handle}, kUnknown), event.time, thread.absent, 0, {}};
  const bool has_sent = thread.taken_by != kUnknown && thread.taken_by == run.callback;
  thread.taken_by = kUnknown;
  if (run.callback != kUnknown) {
    CallbackRecord &callback = callbacks_[run.callback];
    if (callback.runs++ == 0) callback.first_start = event.time;
    callback.last_start = event.time;
    if (event.value != 0) ++callback.intra_process;
    if (callback.begun.size() < kMostArrivals) {
      callback.begun.push_back(event.time);
      if (has_sent) callback.sent.push_back(thread.sent);
    }
    std::uint32_t at_once = 1;
    for (auto other = threads_.lower_bound({event.process, 0}); other != threads_.end(); ++other) {
      if (other->first.first != event.process) break;
      if (&other->second == &thread) continue;
      for (const Run &beside : other->second.runs) {
        if (beside.callback == kUnknown) continue;
        if (beside.callback == run.callback) {
          ++at_once;
        } else if (callbacks_[beside.callback].id.node == callback.id.node) {
          callback.overlaps.insert(beside.callback);
          callbacks_[beside.callback].overlaps.insert(run.callback);
        }
      }
    }
    callback.most_at_once = std::max(callback.most_at_once, at_once);
  }
  thread.runs.push_back(std::move(run));
}

void Recording::end(const RosEvent &event) {
  Thread &thread = thread_of(event);
  ProcessRecord &process = processes_[event.process];
  const auto is_it = [&](const Run &run) { return run.handle == event.handle; };
  if (std::none_of(thread.runs.begin(), thread.runs.end(), is_it)) {
    ++process.torn_runs;
    return;
  }
  for (; !is_it(thread.runs.back()); thread.runs.pop_back()) ++process.torn_runs;
  const Run run = std::move(thread.runs.back());
  thread.runs.pop_back();
  const Duration whole = std::max<Duration>(event.time - run.start - (thread.absent - run.absent), 0);
  const Duration own = std::max<Duration>(whole - run.inner, 0);
  if (!thread.runs.empty()) thread.runs.back().inner += whole;
  ++process.runs;
  process.executed += own;
  if (run.callback == kUnknown) {
    ++process.unknown_runs;
    process.unknown_executed += own;
    return;
  }
  CallbackRecord &callback = callbacks_[run.callback];
  callback.executed += own;
  (run.sent.empty() ? callback.quiet : callback.publishing).add(own);
  for (const Sent &sent : run.sent) {
    CallbackRecord::Output &output = callback.outputs[sent.topic];
    ++output.runs;
    output.messages += std::max(sent.directly, sent.by_middleware);
  }
}

void Recording::publish(const RosEvent &event) {
  const std::size_t topic = find_or(publishers_, Key{event.process, event.handle}, kUnknown);
  if (topic == kUnknown) return;
  Thread &thread = thread_of(event);
  if (thread.runs.empty()) {
    ++topics_[topic].outside;
    return;
  }
  std::vector<Sent> &sent = thread.runs.back().sent;
  auto entry = std::find_if(sent.begin(), sent.end(), [&](const Sent &known) { return known.topic == topic; });
  if (entry == sent.end()) entry = sent.insert(entry, Sent{topic, 0, 0});
  ++(event.kind == Kind::Publish ? entry->by_middleware : entry->directly);
}

void Recording::switch_threads(const RosEvent &event) {
  const auto find = [&](std::uint64_t thread) -> Thread * {
    const auto key = of_kernel_.find(thread);
    return key == of_kernel_.end() ? nullptr : &threads_[key->second];
  };
  if (Thread *leaving = find(event.handle)) {
    leaving->left = event.time;
    leaving->process->has_switches = true;
  }
  if (Thread *coming = find(event.other)) {
    if (coming->left) coming->absent += event.time - *coming->left;
    coming->left.reset();
    coming->process->has_switches = true;
  }
}

}  // namespace redag::lab
