#include "redag/analysis/global_groups.hpp"

#include <algorithm>
#include <vector>

#include "redag/analysis/arithmetic.hpp"
#include "redag/analysis/fixed_point.hpp"
#include "redag/analysis/global.hpp"
#include "redag/analysis/global_dag.hpp"
#include "redag/analysis/rate_edges.hpp"

namespace redag::analysis {
namespace {

using global::GlobalUnit;
using global::SharedTerms;

// What a unit does in a group.
struct Share {
  std::uint32_t tasks = 0;
  Duration volume = 0;
  Duration least = kUnbounded;
  Duration most = 0;
};

class Analysis {
 public:
  explicit Analysis(const System &system)
      : system_(system),
        preempts_(system.mode != sched::Preemption::None),
        view_(global::units_of(
            system, {.mode = preempts_ ? sched::Preemption::Full : sched::Preemption::None, .groups = true})) {
    if (view_.reason) return;
    shares_.assign(view_.units.size(), std::vector<Share>(system.groups.size()));
    for (std::size_t u = 0; u < view_.units.size(); ++u) {
      for (const std::uint32_t t : system.units[view_.units[u].unit].tasks) add_task(shares_[u], system.tasks[t]);
    }
  }

  [[nodiscard]] const std::optional<std::string> &reason() const { return view_.reason; }

  Bound run() {
    std::vector<ResponseBound> responses(system_.units.size());
    bool known = true;
    for (std::size_t k = 0; k < view_.units.size(); ++k) {
      ResponseBound &response = responses[view_.units[k].unit];
      if (!known) {
        response.absent = global::kMoreUrgent;
      } else if (respond(k)) {
        response = itemise(k);
      } else {
        known = false;
        response.absent = global::kNoFixedPoint;
      }
    }
    return from_units(system_, std::move(responses));
  }

 private:
  // The waits in one window.
  struct Waits {
    Duration shared = 0;  // work that all workers do together
    Duration serial = 0;  // for groups
  };

  static void add_task(std::vector<Share> &shares, const SystemTask &task) {
    if (task.group == kNoGroup) return;
    Share &share = shares[task.group];
    ++share.tasks;
    share.volume = add(share.volume, task.wcet);
    share.least = std::min(share.least, task.wcet);
    share.most = std::max(share.most, task.wcet);
  }

  // Work of one DAG's members of a group in a window: they run one after the other, like one task.
  [[nodiscard]] static Duration serial_work(const GlobalUnit &dag, const Share &share, Duration x) {
    if (share.tasks == 0) return 0;
    const Duration until = x + dag.response - share.volume;
    return until / dag.period * share.volume + std::min(share.volume, until % dag.period);
  }

  // Of the group's members in the DAG at least one is on the path that waits, or the path does not wait for the group.
  [[nodiscard]] static Duration own_others(const Share &share) {
    return share.tasks > 1 ? share.volume - share.least : 0;
  }

  // What is left of the longest less urgent member, once it has started.
  [[nodiscard]] Duration longest_holder(std::size_t k, std::size_t group) const {
    Duration most = 0;
    for (std::size_t l = k + 1; l < shares_.size(); ++l) most = std::max(most, shares_[l][group].most - 1);
    return most;
  }

  // One that started before the task on the path became ready: once a task on the path.
  [[nodiscard]] Duration less_urgent(std::size_t k, std::size_t group) const {
    return multiply(longest_holder(k, group), shares_[k][group].tasks);
  }

  // With preemption a less urgent job takes a worker only while it holds the group that an own or a more urgent job
  // waits for: each of these finds at most one such holder. Those of own jobs are in less_urgent(), in full.
  [[nodiscard]] Duration inherited(std::size_t k, Duration x) const {
    Duration sum = 0;
    for (std::size_t g = 0; g < system_.groups.size(); ++g) {
      Duration waiting = 0;
      for (std::size_t j = 0; j < k; ++j) waiting += jobs_of_group(j, g, x);
      sum = add(sum, multiply(longest_holder(k, g), waiting));
    }
    return sum;
  }

  // In progress at some time in the window.
  [[nodiscard]] Duration jobs_of_group(std::size_t j, std::size_t group, Duration x) const {
    const GlobalUnit &unit = view_.units[j];
    return shares_[j][group].tasks * ceil_div(x + unit.response, unit.period);
  }

  [[nodiscard]] Waits waits(std::size_t k, Duration x) const {
    const GlobalUnit &own = view_.units[k];
    Waits result;
    result.shared = own.volume - own.length;
    Duration ends = own.path_tasks - 1;  // after which less urgent jobs can be found started
    for (std::size_t j = 0; j < k; ++j) result.shared = add(result.shared, global::dag_work(view_.units[j], x));
    for (std::size_t g = 0; g < system_.groups.size(); ++g) {
      const Share &mine = shares_[k][g];
      if (mine.tasks == 0) continue;
      const Duration lower = less_urgent(k, g);
      result.serial = add(result.serial, add(own_others(mine), lower));
      ends += mine.tasks - 1 + (lower > 0 ? mine.tasks : 0);
      for (std::size_t j = 0; j < k; ++j) {
        const GlobalUnit &other = view_.units[j];
        result.serial = add(result.serial, serial_work(other, shares_[j][g], x));
        ends += jobs_of_group(j, g, x);
      }
    }
    result.shared = add(result.shared, preempts_ ? inherited(k, x) : blocking(k, ends));
    return result;
  }

  [[nodiscard]] Duration blocking(std::size_t k, Duration ends) const {
    return add(first_[k], multiply(later_[k], ends));
  }

  bool respond(std::size_t k) {
    GlobalUnit &own = view_.units[k];
    const std::uint32_t m = view_.workers;
    first_.resize(view_.units.size());
    later_.resize(view_.units.size());
    first_[k] = global::largest_remaining(system_, view_.units, k + 1, m);
    later_[k] = m > 1 ? global::largest_remaining(system_, view_.units, k + 1, m - 1) : 0;
    Duration window = own.length;
    const bool found = global::least_fixed_point(own.limit - own.jitter, window, [&](Duration x) {
      const Waits in_window = waits(k, x);
      return add(add(own.length, in_window.shared / m), in_window.serial);
    });
    own.response = window + own.jitter;
    return found;
  }

  [[nodiscard]] ResponseBound itemise(std::size_t k) const {
    const GlobalUnit &own = view_.units[k];
    const std::uint32_t m = view_.workers;
    const Duration x = own.response - own.jitter;
    SharedTerms terms(system_, own);
    terms.add_path();
    terms.add_share(Term::Kind::Own, own, own.volume - own.length, m);
    Duration shared = own.volume - own.length;
    for (std::size_t j = 0; j < k; ++j) {
      const Duration work = global::dag_work(view_.units[j], x);
      terms.add_share(Term::Kind::Interference, view_.units[j], work, m);
      shared += work;
    }
    terms.add_share(Term::Kind::Blocking, own, waits(k, x).shared - shared, m);
    for (std::size_t g = 0; g < system_.groups.size(); ++g) {
      if (shares_[k][g].tasks == 0) continue;
      terms.add(Term::Kind::Own, own, own_others(shares_[k][g]));
      terms.add(Term::Kind::Blocking, own, less_urgent(k, g));
      for (std::size_t j = 0; j < k; ++j) {
        terms.add(Term::Kind::Interference, view_.units[j], serial_work(view_.units[j], shares_[j][g], x));
      }
    }
    terms.add_jitter();
    ResponseBound bound;
    bound.response = own.response;
    bound.terms = terms.take();
    return bound;
  }

  const System &system_;
  bool preempts_;
  global::Units view_;
  std::vector<std::vector<Share>> shares_;  // by position in view_, then group
  std::vector<Duration> first_;             // less urgent work that the path can find at its start
  std::vector<Duration> later_;             // and after each further end
};

Outcome apply_groups(const System &system) {
  if (system.groups.empty()) return NotApplicable{"no exclusive group is shared: see the bounds without"};
  Analysis analysis(system);
  if (analysis.reason()) return NotApplicable{*analysis.reason()};
  return analysis.run();
}

}  // namespace

Method dag_groups() {
  Method method;
  method.name = "dag_groups";
  method.subject = Subject::Dag;
  method.cite = "docs/analysis.md, \"Exclusive groups\"";
  method.assumptions =
      "m workers, full preemption (a group's holder inherits) or none, static priorities that keep DAGs together, one "
      "rate a DAG, R <= T; release jitter, exclusive groups within and across DAGs; no max_active, no shared levels";
  method.complexity = "pseudo-polynomial; O(DAGs^2 groups) a step";
  method.apply = [](const System &system) { return across_rates(system, apply_groups); };
  return method;
}

}  // namespace redag::analysis
