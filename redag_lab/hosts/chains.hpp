// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Chains over hosts: from the release of a source on one host, over links, to the end of a sink on another. Each answer
// has bounds of its end-to-end latency that contain the true one if the clocks and links are as stated, and a verdict
// that follows from them: a miss that the clocks' uncertainty could explain is none. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_lab/hosts/merged_run.hpp"

namespace redag::hosts {

/// Each job of `from` that ends releases one of `to`, at most `transport` later. Names are HOST.DAG.TASK.
struct Link {
  std::string from = {};
  std::string to = {};
  Duration transport = 0;
  std::string file = {};  // where it stands; empty: on the command line
  int line = 0;
  int column = 0;
};

/// Reads "HOST.DAG.TASK,HOST.DAG.TASK,500us".
[[nodiscard]] Result<Link> parse_link(std::string_view text);

/// A link of the merged run.
struct Crossing {
  TaskId from = {};
  TaskId to = {};
  Duration transport = 0;
};

struct Chain {
  std::string name;             // "vision.camera.detect -> drive.avoid.obstacles -> drive.avoid.brake"
  std::vector<Crossing> links;  // at least one
  TaskId sink;
  Duration deadline = 0;  // from the release of the source on the first host; 0: none
};

/// Returns all longest chains of these links, one for each sink that they lead to. Errors, at the link: an unknown
/// task; tasks of one host; a target with predecessors; data of several sources at its end; links in a circle.
[[nodiscard]] Result<std::vector<Chain>> find_chains(const MergedRun &merged, std::span<const Link> links);

enum class Verdict : std::uint8_t { Met, Missed, Unknown };

[[nodiscard]] const char *to_string(Verdict verdict);

/// A latency within these bounds meets a deadline, misses it, or cannot be told to.
[[nodiscard]] Verdict judge(const Interval &latency, Duration deadline);

struct Answer {
  std::uint32_t job = 0;  // of the sink
  Time finish = 0;        // of the sink, in merged time
  Interval latency;
  bool is_ambiguous = false;  // the clocks do not tell which of several jobs of a link's `from` released its `to`

  friend bool operator==(const Answer &, const Answer &) = default;
};

struct ChainFigures {
  std::uint64_t answers = 0;                // jobs of the sink that finished
  std::array<std::uint64_t, 3> verdicts{};  // by Verdict; all 0 without a deadline
  std::uint64_t ambiguous = 0;
  std::uint64_t unmatched = 0;  // more jobs of the sink that finished, and no job of `from` can have released them
  Interval shortest;            // of the answer with the shortest lower bound
  Interval longest;             // of the answer with the longest upper bound
  Duration widest = 0;          // the largest difference between the bounds of an answer
  std::vector<Interval> first;  // of the first kMostKept answers
  std::vector<Answer> worst;    // at most kMostWorst, the longest upper bound first

  static constexpr std::size_t kMostKept = std::size_t{1} << 16U;
  static constexpr std::size_t kMostWorst = 40;

  [[nodiscard]] std::uint64_t count(Verdict verdict) const { return verdicts[static_cast<std::size_t>(verdict)]; }
};

/// Follows the chains through the events of a merged run. Memory does not grow with the run.
class ChainWatch {
 public:
  /// `merged` must outlive this object.
  ChainWatch(const MergedRun &merged, std::vector<Chain> chains);

  void add(std::span<const JobEvent> events);
  /// Ends the run. Call once, before figures().
  void finish();

  [[nodiscard]] const std::vector<Chain> &chains() const { return chains_; }
  [[nodiscard]] const std::vector<ChainFigures> &figures() const { return figures_; }

 private:
  // What is remembered of a task: its last jobs, by release (targets of links) and by finish (sources of links).
  struct Target {
    Time release = 0;
    Time seen = 0;
  };
  struct Source {
    Time finish = 0;
    Time origin = 0;
  };
  struct Memory {
    bool is_target = false;
    bool is_source = false;
    std::vector<std::uint32_t> sink_of;  // chains
    std::deque<Target> targets;
    std::deque<Source> sources;
  };
  struct Waiting {
    std::uint32_t chain = 0;
    std::uint32_t job = 0;
    Time finish = 0;
    Time origin = 0;
  };
  // When the source of an answer can have been released, in merged time, and whether several jobs can have caused it.
  struct Origin {
    Interval times;
    bool is_ambiguous = false;
  };
  enum class Trace : std::uint8_t { Found, None, BeforeRun };

  void take(const metrics::JobRecord &job);
  void resolve(const Waiting &waiting);
  [[nodiscard]] Trace trace_back(const Chain &chain, std::size_t link, Time origin, Origin &out) const;
  [[nodiscard]] const Host &host_of(TaskId task) const { return merged_.hosts[merged_.host_of_task[task.value]]; }
  void count(const Chain &chain, ChainFigures &figures, const Answer &answer);

  const MergedRun &merged_;
  std::vector<Chain> chains_;
  std::vector<ChainFigures> figures_;
  std::vector<Memory> memory_;  // by TaskId
  metrics::JobFolder folder_;
  std::deque<Waiting> waiting_;
  Duration delay_ = 0;  // how long an answer waits for events of other hosts that are before it in true time
};

}  // namespace redag::hosts
