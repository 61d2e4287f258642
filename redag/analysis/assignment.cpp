#include "redag/analysis/assignment.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <tuple>

#include "redag/analysis/arithmetic.hpp"
#include "redag/base/rng.hpp"
#include "redag/sched/policy.hpp"

namespace redag::analysis {
namespace {

class Scorer {
 public:
  void see(const Tightest &tightest, Duration due) {
    if (!tightest.response) {
      ++score_.unbounded;
      return;
    }
    const Duration lateness = *tightest.response - due;
    const double slack = -static_cast<double>(lateness) / static_cast<double>(due);
    score_.worst_lateness = any_ ? std::max(score_.worst_lateness, lateness) : lateness;
    score_.least_slack = any_ ? std::min(score_.least_slack, slack) : slack;
    score_.total = add(score_.total, *tightest.response);
    any_ = true;
  }

  [[nodiscard]] const Score &score() const { return score_; }

 private:
  Score score_;
  bool any_ = false;
};

Caps caps_of(const Workload &workload) {
  Caps caps;
  for (const Dag &dag : workload.dags) caps.push_back(dag.max_active);
  return caps;
}

Workload with_caps(Workload workload, const Caps &caps) {
  for (std::size_t d = 0; d < caps.size(); ++d) workload.dags[d].max_active = caps[d];
  return workload;
}

// The policy itself; priorities that it would ignore go where the workload relied on them.
Workload with_policy(Workload workload, PolicyKind policy) {
  if (workload.policy == PolicyKind::Fixed) {
    for (Dag &dag : workload.dags) {
      for (Task &task : dag.tasks) task.priority.reset();
    }
  }
  workload.policy = policy;
  return workload;
}

class Search {
 public:
  Search(const Workload &workload, const AnalysisPlatform &platform, const AssignmentOptions &options)
      : workload_(workload), platform_(platform), options_(options) {
    for (const Dag &dag : workload.dags) {
      Caps values = {dag.max_active};
      const auto most = static_cast<std::uint32_t>(std::min<std::size_t>(dag.tasks.size(), platform.workers + 1ULL));
      for (std::uint32_t cap = 0; options.caps && dag.tasks.size() > 1 && cap < most; ++cap) {
        if (cap != dag.max_active) values.push_back(cap);
      }
      std::sort(values.begin(), values.end());
      values_.push_back(std::move(values));
    }
  }

  Assignment run() {
    Assignment &result = result_;
    result.present = judged("present", workload_, caps_of(workload_));
    result.best = result.present;
    const bool may_order =
        options_.priorities && (sched::is_static(workload_.policy) || !result.present.score.schedulable);
    add_order("present", workload_);
    if (may_order) {
      if (workload_.policy != PolicyKind::RateMonotonic) {
        add_order("rate_monotonic", with_policy(workload_, PolicyKind::RateMonotonic));
      }
      if (workload_.policy != PolicyKind::DeadlineMonotonic) {
        add_order("deadline_monotonic", with_policy(workload_, PolicyKind::DeadlineMonotonic));
      }
      const Result<System> system = compile(workload_, platform_);
      if (platform_.workers > 1) add_order("dkc", with_order(workload_, *system, dkc_order(*system)));
      add_audsley(*system);
    } else {
      result.audsley_reason = "priorities are to stay as they are";
    }
    return std::move(result_);
  }

 private:
  bool stopped() {
    result_.stopped = result_.stopped || (options_.stop && options_.stop());
    return result_.stopped;
  }

  Candidate judged(const std::string &name, const Workload &ordered, const Caps &caps) {
    Candidate candidate;
    candidate.order = name;
    candidate.workload = with_caps(ordered, caps);
    candidate.caps = caps;
    const Result<System> system = compile(candidate.workload, platform_);
    ++result_.analyses;
    if (!system) return candidate;  // assign() has compiled the workload: only its order and caps differ
    candidate.units = present_order(*system);
    candidate.score = score_of(*system);
    return candidate;
  }

  [[nodiscard]] bool is_better_than(const Score &a, const Score &b) const {
    return is_better(a, b, options_.objective);
  }

  void add_audsley(const System &system) {
    const TestChoice choice = order_free_test(workload_, platform_);
    if (!choice.test) {
      result_.audsley_reason = choice.reason;
      return;
    }
    result_.audsley_test = choice.test->name;
    result_.audsley_optimal = choice.test->optimal;
    const Objective objective = options_.objective;
    const Badness badness = [objective](Duration response, Duration due) {
      const auto late = static_cast<double>(response - due);
      return objective == Objective::Lateness ? late : late / static_cast<double>(due);
    };
    const auto found = audsley(workload_, platform_, *choice.test, badness, [this] { return stopped(); });
    if (!found) return;
    result_.audsley_found = found->found;
    add_order("audsley", with_order(workload_, system, found->order));
  }

  // The best caps under one order. What only lowers the sum of bounds is no reason to change caps that somebody chose.
  void add_order(const std::string &name, const Workload &ordered) {
    if (stopped()) return;
    trials_.clear();
    const Candidate start = judged(name, ordered, caps_of(workload_));
    Candidate best = start;
    trials_[best.caps] = best.score;
    if (combinations() <= options_.exhaustive) {
      try_all(name, ordered, best);
    } else {
      result_.exhaustive = false;
      search_locally(name, ordered, best);
    }
    if (!improves(best.score, start.score, options_.objective)) best = start;
    const bool is_best = improves(best.score, result_.best.score, options_.objective);
    if (is_best || result_.orders.empty()) {
      result_.trials.clear();
      for (const auto &[caps, score] : trials_) result_.trials.push_back(Trial{caps, score});
    }
    if (is_best) result_.best = best;
    result_.orders.push_back(std::move(best));
  }

  [[nodiscard]] std::uint64_t combinations() const {
    std::uint64_t product = 1;
    for (const Caps &values : values_) {
      product *= values.size();
      if (product > options_.exhaustive) break;
    }
    return product;
  }

  Score tried(const std::string &name, const Workload &ordered, const Caps &caps, Candidate &best) {
    if (const auto known = trials_.find(caps); known != trials_.end()) return known->second;
    Candidate candidate = judged(name, ordered, caps);
    const Score score = candidate.score;
    trials_[caps] = score;
    if (is_better_than(score, best.score)) best = std::move(candidate);
    return score;
  }

  void try_all(const std::string &name, const Workload &ordered, Candidate &best) {
    std::vector<std::size_t> at(values_.size(), 0);
    while (!stopped()) {
      Caps caps;
      for (std::size_t d = 0; d < at.size(); ++d) caps.push_back(values_[d][at[d]]);
      (void)tried(name, ordered, caps, best);
      std::size_t d = 0;
      while (d < at.size() && ++at[d] == values_[d].size()) at[d++] = 0;
      if (d == at.size()) return;
    }
  }

  void search_locally(const std::string &name, const Workload &ordered, Candidate &best) {
    std::vector<Caps> starts = {caps_of(workload_)};
    for (const std::uint32_t cap : {0U, 1U}) {
      Caps caps;
      for (const Caps &values : values_) {
        const bool has = std::find(values.begin(), values.end(), cap) != values.end();
        caps.push_back(has ? cap : values.front());
      }
      starts.push_back(std::move(caps));
    }
    Rng rng(options_.seed);
    for (std::uint32_t i = 0; i < options_.restarts; ++i) {
      Caps caps;
      for (const Caps &values : values_) {
        caps.push_back(values[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(values.size()) - 1))]);
      }
      starts.push_back(std::move(caps));
    }
    for (Caps &start : starts) climb(name, ordered, std::move(start), best);
  }

  // One DAG at a time to its best value, until a whole round changes nothing.
  void climb(const std::string &name, const Workload &ordered, Caps caps, Candidate &best) {
    if (stopped()) return;
    Score here = tried(name, ordered, caps, best);
    bool changed = true;
    while (changed) {
      changed = false;
      for (std::size_t d = 0; d < caps.size(); ++d) {
        for (const std::uint32_t value : values_[d]) {
          if (stopped()) return;
          Caps next = caps;
          next[d] = value;
          const Score score = tried(name, ordered, next, best);
          if (!is_better_than(score, here)) continue;
          caps = std::move(next);
          here = score;
          changed = true;
        }
      }
    }
  }

  const Workload &workload_;
  const AnalysisPlatform &platform_;
  const AssignmentOptions &options_;
  std::vector<Caps> values_;      // of each DAG
  std::map<Caps, Score> trials_;  // under the order at hand
  Assignment result_;
};

}  // namespace

const char *to_string(Objective objective) { return objective == Objective::Lateness ? "lateness" : "slack"; }

bool is_better(const Score &a, const Score &b, Objective objective) {
  if (a.schedulable != b.schedulable) return a.schedulable;
  if (a.unbounded != b.unbounded) return a.unbounded < b.unbounded;
  if (objective == Objective::Lateness && a.worst_lateness != b.worst_lateness) {
    return a.worst_lateness < b.worst_lateness;
  }
  if (objective == Objective::Slack && a.least_slack != b.least_slack) return a.least_slack > b.least_slack;
  return a.total < b.total;
}

bool improves(const Score &a, const Score &b, Objective objective) {
  Score same_total = a;
  same_total.total = b.total;
  return is_better(same_total, b, objective);
}

Score score_of(const System &system) {
  const Report report = analyze(system);
  Scorer scorer;
  for (std::size_t t = 0; t < system.tasks.size(); ++t) {
    scorer.see(report.tasks[t], std::min(system.tasks[t].deadline, system.tasks[t].limit));
  }
  for (std::size_t d = 0; d < system.dags.size(); ++d) {
    if (system.dags[d].deadline > 0) scorer.see(report.dags[d], system.dags[d].deadline);
  }
  Score score = scorer.score();
  score.schedulable = report.verdict == Verdict::Schedulable;
  return score;
}

Result<Assignment> assign(const Workload &workload, const AnalysisPlatform &platform,
                          const AssignmentOptions &options) {
  if (const Result<System> system = compile(workload, platform); !system) {
    return tl::unexpected<Diagnostics>(system.error());
  }
  return Search(workload, platform, options).run();
}

}  // namespace redag::analysis
