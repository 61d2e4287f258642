// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/deadlock_detector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

namespace redag_rclcpp {

using redag::Duration;
using redag::Time;
using redag::runtime::StartedJob;
using Side = Exchange::Side;

namespace {

constexpr std::uint32_t kEnoughLooks = 2;

std::string text_of(const Endpoint &endpoint) {
  if (!endpoint.exchange.is_action) return endpoint.place.name;
  return fmt::format("{} (action {} of {})", endpoint.place.name,
                     endpoint.exchange.side == Side::Client ? "client" : "server", endpoint.exchange.name);
}

bool is_same(const Exchange &a, const Exchange &b) { return a.is_action == b.is_action && a.name == b.name; }

}  // namespace

/// The executor at one look: who waits, for what, and who is in the way.
class DeadlockDetector::Picture {
 public:
  Picture(Time now, std::span<const StartedJob> started, const std::map<std::uint32_t, Still> &still,
          const DeadlockView &view)
      : now_(now), workers_(view.workers()), endpoints_(view.endpoints()) {
    for (const StartedJob &job : started) {
      jobs_.push_back({.place = view.place_of(job.job.task), .top = tops_.size()});
      if (!job.on_top) continue;
      const auto found = still.find(job.thread);
      const bool is_still = found != still.end() && found->second.waits;
      tops_.push_back({.job = job, .still = is_still ? found->second : Still(), .place = jobs_.size() - 1});
    }
    find_edges();
  }

  /// The deadlocks of jobs of which it is certain, or not certain, what they wait for.
  [[nodiscard]] std::vector<Reported> deadlocks(bool certain) const {
    std::set<std::size_t> locked;
    for (const Edge &edge : edges_) {
      if (counts(edge, certain)) locked.insert(edge.top);
    }
    // One job that can go on frees what it has. What remains is the largest set of jobs that wait for each other.
    const auto holds = [&](const Edge &edge) {
      return counts(edge, certain) && locked.count(edge.top) > 0 &&
             std::includes(locked.begin(), locked.end(), edge.block.tops.begin(), edge.block.tops.end());
    };
    for (std::size_t before = locked.size() + 1; before > locked.size();) {
      before = locked.size();
      std::set<std::size_t> remaining;
      for (const Edge &edge : edges_) {
        if (holds(edge)) remaining.insert(edge.top);
      }
      locked = std::move(remaining);
    }
    std::vector<Reported> found;
    for (const std::size_t top : locked) {
      const Edge *best = nullptr;
      for (const Edge &edge : edges_) {
        if (edge.top == top && holds(edge) && (best == nullptr || rank(edge) < rank(*best))) best = &edge;
      }
      if (best != nullptr) found.push_back(describe(*best, certain));
    }
    return found;
  }

  [[nodiscard]] bool is_kept(const std::string &blocked, Time arrived) const {
    return std::any_of(endpoints_.begin(), endpoints_.end(), [&](const Endpoint &endpoint) {
      return text_of(endpoint) == blocked &&
             std::any_of(endpoint.kept.begin(), endpoint.kept.end(),
                         [&](const KeptInput &kept) { return kept.arrived == arrived; });
    });
  }

 private:
  struct Job {
    CallbackPlace place;
    std::size_t top = 0;  // index of its thread's topmost job in tops_
  };
  struct Top {
    StartedJob job;
    Still still;            // `looks` 0: it makes progress
    std::size_t place = 0;  // index in jobs_
  };
  /// Why a callback cannot start.
  struct Block {
    enum class Kind : std::uint8_t { Group, Dag, Workers };
    Kind kind = Kind::Group;
    std::set<std::size_t> tops = {};  // each of them could end it
    std::size_t holder = 0;           // Group: index in jobs_
  };
  /// A job waits for an input that was not taken.
  struct Edge {
    std::size_t top = 0;
    const Endpoint *endpoint = nullptr;
    Time arrived = 0;
    bool is_sender = false;
    bool is_certain = false;
    Block block;
  };

  [[nodiscard]] std::optional<Block> block_of(const CallbackPlace &place) const {
    Block block;
    for (std::size_t i = 0; i < jobs_.size() && !place.group.empty(); ++i) {
      if (jobs_[i].place.group != place.group) continue;
      block.tops.insert(jobs_[i].top);
      block.holder = i;
      return block;
    }
    std::uint32_t active = 0;
    for (const Job &job : jobs_) {
      if (place.max_active == 0 || job.place.dag != place.dag) continue;
      ++active;
      block.tops.insert(job.top);
    }
    block.kind = Block::Kind::Dag;
    if (place.max_active > 0 && active >= place.max_active) return block;
    block = {.kind = Block::Kind::Workers};
    for (std::size_t i = 0; i < tops_.size(); ++i) {
      if (!tops_[i].job.lends) block.tops.insert(i);
    }
    if (block.tops.size() >= workers_) return block;
    return std::nullopt;
  }

  /// True if the job may wait for the response of another client of its node, which could still reach it.
  [[nodiscard]] bool has_alternative(const std::string &node, const Exchange &except) const {
    return std::any_of(endpoints_.begin(), endpoints_.end(), [&](const Endpoint &endpoint) {
      return endpoint.exchange.side == Side::Client && endpoint.place.node == node &&
             !is_same(endpoint.exchange, except) && !block_of(endpoint.place);
    });
  }
  [[nodiscard]] bool has_client(const std::string &node, const Exchange &exchange) const {
    return std::any_of(endpoints_.begin(), endpoints_.end(), [&](const Endpoint &endpoint) {
      return endpoint.exchange.side == Side::Client && endpoint.place.node == node &&
             is_same(endpoint.exchange, exchange);
    });
  }

  void find_edges() {
    for (const Endpoint &endpoint : endpoints_) {
      if (endpoint.kept.empty()) continue;
      const std::optional<Block> block = block_of(endpoint.place);
      if (!block) continue;
      for (std::size_t top = 0; top < tops_.size(); ++top) {
        if (tops_[top].still.looks == 0) continue;
        for (const KeptInput &kept : endpoint.kept) add_edge(top, endpoint, kept, *block);
      }
    }
  }

  void add_edge(std::size_t top, const Endpoint &endpoint, const KeptInput &kept, const Block &block) {
    const StartedJob &job = tops_[top].job;
    if (kept.arrived < job.begun) return;  // it answers to an earlier job
    const std::string &node = place_of(top).node;
    bool is_sender = false;
    bool is_related = endpoint.place.node == node;
    if (endpoint.exchange.side == Side::Server) {
      is_sender = kept.sender == job.job.slot;
      if (kept.sender.valid() && !is_sender) return;  // another job's request
      is_related = is_sender || has_client(node, endpoint.exchange);
      if (!is_related) return;
    }
    const bool is_certain = is_sender || (is_related && !has_alternative(node, endpoint.exchange));
    edges_.push_back({.top = top,
                      .endpoint = &endpoint,
                      .arrived = kept.arrived,
                      .is_sender = is_sender,
                      .is_certain = is_certain,
                      .block = block});
  }

  [[nodiscard]] bool counts(const Edge &edge, bool certain) const {
    const Still &still = tops_[edge.top].still;
    if (certain && (!edge.is_certain || still.looks_at_future < kEnoughLooks)) return false;
    const Duration least = certain ? kStill : kStillUncertain;
    return still.looks >= kEnoughLooks && now_ - still.since >= least && now_ - edge.arrived >= least;
  }

  /// The less, the better the edge explains why its job does not go on.
  [[nodiscard]] static std::tuple<bool, bool, bool, bool, Time> rank(const Edge &edge) {
    return {!edge.is_sender, !edge.is_certain, edge.block.tops.count(edge.top) == 0,
            edge.endpoint->exchange.side == Side::Server, edge.arrived};
  }

  [[nodiscard]] const CallbackPlace &place_of(std::size_t top) const { return jobs_[tops_[top].place].place; }

  [[nodiscard]] std::string names_of(const std::set<std::size_t> &tops) const {
    constexpr std::size_t kMost = 4;
    std::string names;
    std::size_t count = 0;
    for (const std::size_t top : tops) {
      if (++count > kMost) return names + fmt::format(" and {} more", tops.size() - kMost);
      names += (names.empty() ? "" : ", ") + place_of(top).name;
    }
    return names;
  }

  [[nodiscard]] std::string resource_of(const Edge &edge) const {
    const CallbackPlace &place = edge.endpoint->place;
    switch (edge.block.kind) {
      case Block::Kind::Group: return place.group_text;
      case Block::Kind::Dag: return fmt::format("a place in DAG {} (max_active {})", place.dag_name, place.max_active);
      case Block::Kind::Workers: break;
    }
    return workers_ == 1 ? "the only worker" : fmt::format("any of the {} workers", workers_);
  }

  [[nodiscard]] std::string obstacle_of(const Edge &edge) const {
    const CallbackPlace &place = edge.endpoint->place;
    switch (edge.block.kind) {
      case Block::Kind::Group:
        return fmt::format("while {} holds {}", jobs_[edge.block.holder].place.name, place.group_text);
      case Block::Kind::Dag:
        return fmt::format("because the places of DAG {} (max_active {}) are taken by callbacks that wait ({})",
                           place.dag_name, place.max_active, names_of(edge.block.tops));
      case Block::Kind::Workers: break;
    }
    const std::string waiting = names_of(edge.block.tops);
    if (workers_ == 1) return fmt::format("because the only worker has a callback that waits ({})", waiting);
    return fmt::format("because all {} workers have callbacks that wait ({})", workers_, waiting);
  }

  [[nodiscard]] std::string remedy_of(const Edge &edge) const {
    const Exchange &exchange = edge.endpoint->exchange;
    const std::string with_function =
        exchange.is_action ? "set the callbacks of SendGoalOptions" : "give async_send_request() a function to call";
    const std::string without = fmt::format("do not wait in the callback ({})", with_function);
    const char *const client = exchange.is_action ? "the action client" : "the client";
    const char *const server = exchange.is_action ? "the action server" : "the service";
    switch (edge.block.kind) {
      case Block::Kind::Group:
        if (exchange.side == Side::Client) {
          return fmt::format("Create {} in a callback group of its own, or {}", client, without);
        }
        return fmt::format("Create {} and {} in callback groups of their own, or {}", server, client, without);
      case Block::Kind::Dag:
        return fmt::format("Raise max_active of DAG {}, or {}", edge.endpoint->place.dag_name, without);
      case Block::Kind::Workers: break;
    }
    return fmt::format("Use more workers than callbacks that wait at the same time (parameter 'workers'), or {}",
                       without);
  }

  [[nodiscard]] Reported describe(const Edge &edge, bool certain) const {
    const StartedJob &job = tops_[edge.top].job;
    const bool is_request = edge.endpoint->exchange.side == Side::Server;
    Reported reported{.task = job.job.task, .number = job.job.number, .arrived = edge.arrived, .deadlock = {}};
    Deadlock &deadlock = reported.deadlock;
    deadlock.waiting = place_of(edge.top).name;
    deadlock.blocked = text_of(*edge.endpoint);
    deadlock.resource = resource_of(edge);
    deadlock.certain = certain;
    deadlock.begun = now_;
    deadlock.text =
        fmt::format("{} {} for a response that cannot {}: {} {} ago, and that callback cannot start {}. {}.",
                    deadlock.waiting, certain ? "waits" : "may wait", is_request ? "come" : "reach it",
                    is_request ? fmt::format("its request reached {}", deadlock.blocked)
                               : fmt::format("the response for {} arrived", deadlock.blocked),
                    redag::humanize_duration(now_ - edge.arrived), obstacle_of(edge), remedy_of(edge));
    return reported;
  }

  const Time now_;
  const std::uint32_t workers_;
  const std::vector<Endpoint> endpoints_;
  std::vector<Job> jobs_;
  std::vector<Top> tops_;
  std::vector<Edge> edges_;
};

void DeadlockDetector::look(Time now, std::span<const StartedJob> started, const DeadlockView &view,
                            std::vector<Deadlock> &begun, std::vector<Deadlock> &ended) {
  const bool is_suspect = track(now, started);
  if (!is_suspect && reported_.empty()) return;
  look_at_threads(now, started, view);
  const Picture picture(now, started, still_, view);

  for (auto reported = reported_.begin(); reported != reported_.end();) {
    const bool is_in_progress = std::any_of(started.begin(), started.end(), [&](const StartedJob &job) {
      return job.job.task == reported->task && job.job.number == reported->number;
    });
    if (is_in_progress && picture.is_kept(reported->deadlock.blocked, reported->arrived)) {
      ++reported;
      continue;
    }
    reported->deadlock.ended = now;
    ended.push_back(std::move(reported->deadlock));
    reported = reported_.erase(reported);
  }

  for (const bool certain : {true, false}) {
    for (Reported &found : picture.deadlocks(certain)) {
      const bool is_known = std::any_of(reported_.begin(), reported_.end(), [&](const Reported &other) {
        return other.task == found.task && other.number == found.number;
      });
      if (is_known) continue;
      begun.push_back(found.deadlock);
      reported_.push_back(std::move(found));
    }
  }
}

// Returns true if a job has made no progress since the last look.
bool DeadlockDetector::track(Time now, std::span<const StartedJob> started) {
  bool is_suspect = false;
  std::map<std::uint32_t, Still> tracked;
  for (const StartedJob &job : started) {
    if (!job.on_top || job.begun == redag::kNever) continue;
    Still still{.task = job.job.task, .number = job.job.number, .since = now, .cpu = job.thread_cpu};
    const auto before = still_.find(job.thread);
    if (before != still_.end() && before->second.task == still.task && before->second.number == still.number) {
      // A loop that polls a future every 10 ms uses less than this.
      const Duration allowed = 2 * redag::kMillisecond + (now - before->second.since) / 100;
      if (job.thread_cpu - before->second.cpu <= allowed) {
        still = before->second;
        is_suspect = true;
      }
    }
    tracked[job.thread] = still;
  }
  still_ = std::move(tracked);
  return is_suspect;
}

void DeadlockDetector::look_at_threads(Time now, std::span<const StartedJob> started, const DeadlockView &view) {
  for (const StartedJob &job : started) {
    const auto found = still_.find(job.thread);
    if (!job.on_top || found == still_.end() || found->second.since == now) continue;
    Still &still = found->second;
    const ThreadWait wait = view.wait_of(job.thread_id);
    still.waits = wait != ThreadWait::None;
    if (still.waits) ++still.looks;
    if (wait == ThreadWait::Future) ++still.looks_at_future;
  }
}

}  // namespace redag_rclcpp
