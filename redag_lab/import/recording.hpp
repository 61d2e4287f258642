// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Recording gathers, from the events of ros2_tracing in the order of time, what each callback did: how often it ran,
// for how long, what it published, and with what it overlapped. Its memory grows with callbacks, not with events. Not
// thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "redag/loader/callback_match.hpp"
#include "redag_analysis/metrics/duration_sketch.hpp"
#include "redag_lab/import/event.hpp"

namespace redag::lab {

/// Arrivals that are kept of each callback, for its rate.
inline constexpr std::size_t kMostArrivals = 4096;
/// Runs that are kept of each callback, for a simulation that repeats them.
inline constexpr std::size_t kMostRuns = 16384;
/// Messages of a topic whose times are kept until a callback takes them.
inline constexpr std::size_t kMostMessages = 32;

/// A run that ended.
struct EndedRun {
  Time start = 0;
  Time end = 0;
  Duration execution = 0;
  std::optional<Time> released;  // when its message was sent; its timer expired: find_units()
  std::optional<Time> free;      // since when its node, and a thread that serves the node, ran nothing
  std::optional<Time> woken;     // when the wait ended that returned it, if the executor idled until then
  bool publishes = false;

  /// By how much the executor and the machine delayed it: other callbacks did not.
  [[nodiscard]] std::optional<Duration> delay() const {
    return released && free ? std::optional(start - std::max(*released, *free)) : std::nullopt;
  }
};

struct CallbackRecord {
  /// What its runs sent to a topic.
  struct Output {
    std::uint64_t runs = 0;  // with at least one message
    std::uint64_t messages = 0;
  };

  CallbackId id;  // the node's name is empty as long as it is unknown
  std::uint32_t process = 0;
  Time created = 0;
  std::uint64_t runs = 0;  // that began
  Time first_start = 0;
  Time last_start = 0;
  metrics::DurationSketch quiet{1024};       // executions of runs that published nothing
  metrics::DurationSketch publishing{1024};  // of the others
  Duration executed = 0;
  std::map<std::string, Output> outputs;  // by topic
  std::vector<EndedRun> ended;            // the first ones
  std::vector<Time> begun;                // when the first runs began
  std::vector<Time> sent;                 // when their messages were sent, as far as the middleware says so
  std::uint64_t node = 0;                 // address
  std::uint64_t group = 0;                // address of its callback group; 0: unknown
  bool takes_directly = false;            // from its own process, not by the middleware
  std::set<std::size_t> overlaps;         // callbacks of its node that ran at the same time
  std::uint32_t most_at_once = 1;         // of its own runs
};

struct ProcessRecord {
  std::string program;
  std::set<std::uint32_t> threads;           // that ran callbacks
  std::set<std::uint32_t> executor_threads;  // these, and others that looked for work
  bool has_switches = false;                 // the kernel recorded some of these threads
  std::uint64_t runs = 0;
  Duration executed = 0;
  std::uint64_t unknown_runs = 0;  // of callbacks whose creation was not recorded
  std::uint64_t torn_runs = 0;     // begin or end is missing
};

class Recording {
 public:
  void add(const RosEvent &event);

  [[nodiscard]] const std::vector<CallbackRecord> &callbacks() const { return callbacks_; }
  [[nodiscard]] const std::map<std::uint32_t, ProcessRecord> &processes() const { return processes_; }
  /// True if messages to this topic came from outside of callbacks, too.
  [[nodiscard]] bool is_sent_elsewhere(const std::string &topic) const { return sent_elsewhere_.contains(topic); }
  /// True if callbacks of this group never overlap.
  [[nodiscard]] bool is_exclusive(std::uint32_t process, std::uint64_t group) const {
    return !reentrant_.contains({process, group});
  }
  /// How often an executor took the second callback after the first, of the same kind, from what one wait returned.
  [[nodiscard]] const std::map<std::pair<std::size_t, std::size_t>, std::uint64_t> &turns() const { return turns_; }
  [[nodiscard]] std::uint64_t events() const { return events_; }
  [[nodiscard]] Time first() const { return first_; }
  [[nodiscard]] Time last() const { return last_; }

 private:
  using Key = std::pair<std::uint32_t, std::uint64_t>;  // process and address
  static constexpr std::size_t kUnknown = SIZE_MAX;
  struct Thread;
  struct Node {
    std::string name;
    std::uint32_t timers = 0;
    std::size_t running = 0;  // callbacks
    Time last_end = 0;
    std::set<const Thread *> threads;  // that ran its callbacks
  };
  struct Sent {
    const std::string *topic = nullptr;  // in publishers_
    std::uint64_t directly = 0;          // one message can be sent both ways
    std::uint64_t by_middleware = 0;
  };
  struct Run {
    std::uint64_t handle = 0;
    std::size_t callback = kUnknown;
    Node *node = nullptr;  // of the callback, if known
    Time start = 0;
    std::optional<Time> released;
    std::optional<Time> free;
    std::optional<Time> woken;
    Duration absent = 0;  // of the thread, when the run began
    Duration inner = 0;   // execution of callbacks that this run called
    std::vector<Sent> sent;
  };
  struct Thread {
    std::vector<Run> runs;  // the innermost is last
    Duration absent = 0;    // without a processor so far
    std::optional<Time> left;
    Time last_end = 0;                // of a run
    std::size_t taken_by = kUnknown;  // whose message was taken last, and when it was sent
    Time sent = 0;
    Time look = 0;             // for work, the last one
    std::uint64_t window = 0;  // that it looked through; 0: no event says so
    bool waits = false;
    ProcessRecord *process = nullptr;
  };
  /// What an executor took last.
  struct Window {
    std::uint64_t number = 0;  // of the last wait
    Time began = 0;
    std::optional<Time> woken;  // when it ended, if the executor idled until then
    std::uint64_t taken_from = 0;
    Time look = 0;
    std::size_t callback = kUnknown;
  };

  void make(const RosEvent &event, Callback::Kind kind);
  [[nodiscard]] std::optional<Time> sent_of(std::size_t callback, const Thread &thread, Time start) const;
  static std::optional<Time> free_since(const Thread &thread, const Node *node);
  std::optional<Time> note_turn(Thread &thread, std::size_t callback);
  void look(const RosEvent &event);
  [[nodiscard]] Node *node_of(std::size_t callback);
  static void leave(const Run &run, Time now);
  [[nodiscard]] std::size_t find(std::uint32_t process, std::uint64_t address) const;
  Thread &thread_of(const RosEvent &event);
  void bind_subscription(const RosEvent &event);
  void start(const RosEvent &event);
  void note_overlaps(const Thread &thread, std::size_t callback);
  void end(const RosEvent &event);
  void publish(const RosEvent &event);
  void switch_threads(const RosEvent &event);

  std::vector<CallbackRecord> callbacks_;
  std::map<std::uint32_t, ProcessRecord> processes_;
  std::set<std::string> sent_elsewhere_;
  std::map<std::string, std::deque<Time>> sent_;  // the last messages of each topic
  std::uint64_t events_ = 0;
  Time first_ = 0;
  Time last_ = 0;
  // An address can serve a later object: the last one counts.
  std::map<Key, Node> nodes_;
  std::set<Key> reentrant_;                 // callback groups
  std::map<Key, std::string> publishers_;   // topics
  std::map<Key, std::size_t> addresses_;    // callbacks by all that stands for them
  std::map<Key, std::uint64_t> unclaimed_;  // callbacks of subscriptions' objects that are not known yet
  std::map<Key, std::size_t> unbound_;      // subscriptions of objects whose callback is not known yet
  std::map<Key, Thread> threads_;
  std::map<std::uint32_t, Window> windows_;  // by process
  std::map<std::pair<std::size_t, std::size_t>, std::uint64_t> turns_;
  std::map<std::uint64_t, Key> of_kernel_;
};

}  // namespace redag::lab
