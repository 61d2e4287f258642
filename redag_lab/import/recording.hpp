// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Recording gathers, from the events of ros2_tracing in the order of time, what each callback did: how often it ran,
// for how long, what it published, and with what it overlapped. Its memory grows with callbacks, not with events. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "redag/model/callback_match.hpp"
#include "redag_analysis/metrics/duration_sketch.hpp"
#include "redag_lab/import/event.hpp"

namespace redag::lab {

/// Arrivals that are kept of each callback, for its rate.
inline constexpr std::size_t kMostArrivals = 4096;

struct CallbackRecord {
  /// What its runs sent to a topic.
  struct Output {
    std::uint64_t runs = 0;  // with at least one message
    std::uint64_t messages = 0;
  };

  CallbackId id;  // the node's name is empty as long as it is unknown
  std::uint32_t process = 0;
  Time created = 0;  // a timer expires each period from here on
  std::uint64_t runs = 0;
  std::uint64_t intra_process = 0;  // runs whose message came so
  Time first_start = 0;
  Time last_start = 0;
  metrics::DurationSketch quiet{1024};       // execution of runs that published nothing
  metrics::DurationSketch publishing{1024};  // and of the others
  Duration executed = 0;
  std::map<std::size_t, Output> outputs;  // by topic
  std::vector<Time> begun;                // when the first runs began
  std::vector<Time> sent;                 // when their messages were sent, as far as the middleware says so
  std::set<std::size_t> overlaps;         // callbacks of its node that ran at the same time
  std::uint32_t most_at_once = 1;         // of its own runs
};

struct TopicRecord {
  std::string name;
  std::uint64_t outside = 0;  // messages that no callback published
};

struct ProcessRecord {
  std::string program;
  std::set<std::uint32_t> threads;           // that ran callbacks
  std::set<std::uint32_t> executor_threads;  // that looked for work, or ran callbacks
  bool has_switches = false;                 // the kernel recorded some of these threads
  std::uint64_t runs = 0;
  Duration executed = 0;
  std::uint64_t unknown_runs = 0;  // of callbacks whose creation was not recorded
  Duration unknown_executed = 0;
  std::uint64_t torn_runs = 0;  // begin or end is missing
};

class Recording {
 public:
  void add(const RosEvent &event);

  [[nodiscard]] const std::vector<CallbackRecord> &callbacks() const { return callbacks_; }
  [[nodiscard]] const std::vector<TopicRecord> &topics() const { return topics_; }
  [[nodiscard]] const std::map<std::uint32_t, ProcessRecord> &processes() const { return processes_; }
  [[nodiscard]] std::optional<std::size_t> find_topic(const std::string &name) const;
  [[nodiscard]] std::uint64_t events() const { return events_; }
  /// Events that are earlier than the one before.
  [[nodiscard]] std::uint64_t disordered() const { return disordered_; }
  [[nodiscard]] Time first() const { return first_; }
  [[nodiscard]] Time last() const { return last_; }

 private:
  using Key = std::pair<std::uint32_t, std::uint64_t>;  // process and handle
  static constexpr std::size_t kUnknown = SIZE_MAX;
  struct Node {
    std::string name;
    std::uint32_t timers = 0;
  };
  struct Sent {
    std::size_t topic = 0;
    std::uint64_t directly = 0;  // one message can be sent both ways
    std::uint64_t by_middleware = 0;
  };
  struct Run {
    std::uint64_t handle = 0;
    std::size_t callback = kUnknown;
    Time start = 0;
    Duration absent = 0;  // of the thread, when the run began
    Duration inner = 0;   // execution of callbacks that this run called
    std::vector<Sent> sent;
  };
  struct Thread {
    std::vector<Run> runs;  // the innermost is last
    Duration absent = 0;    // without a processor so far
    std::optional<Time> left;
    std::size_t taken_by = kUnknown;  // whose message was taken last, and when it was sent
    Time sent = 0;
    ProcessRecord *process = nullptr;
  };

  std::size_t make(const RosEvent &event, Callback::Kind kind);
  std::size_t topic_of(std::string_view name);
  Thread &thread_of(const RosEvent &event);
  void bind(const std::map<Key, std::size_t> &owners, const RosEvent &event);
  void bind_subscription(const RosEvent &event);
  void start(const RosEvent &event);
  void end(const RosEvent &event);
  void publish(const RosEvent &event);
  void switch_threads(const RosEvent &event);

  std::vector<CallbackRecord> callbacks_;
  std::vector<TopicRecord> topics_;
  std::map<std::uint32_t, ProcessRecord> processes_;
  std::uint64_t events_ = 0;
  std::uint64_t disordered_ = 0;
  Time first_ = 0;
  Time last_ = 0;

  // An address can serve a later object: the last one counts.
  std::map<std::string, std::size_t, std::less<>> topic_names_;
  std::map<Key, Node> nodes_;
  std::map<Key, std::size_t> publishers_;  // topics
  std::map<Key, std::size_t> timers_;      // callbacks, like all that follow
  std::map<Key, std::size_t> services_;
  std::map<Key, std::size_t> subscriptions_;
  std::map<Key, std::size_t> taking_;
  std::map<Key, std::size_t> objects_;
  std::map<Key, std::uint64_t> unclaimed_;  // callbacks of objects that are not known yet
  std::map<Key, std::size_t> handles_;
  std::map<Key, Thread> threads_;
  std::map<std::uint64_t, Key> of_kernel_;
};

}  // namespace redag::lab
