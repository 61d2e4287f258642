// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/contention.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"

namespace redag::analysis::global {
namespace {

// Shares are exact in units of 1 / scale.
constexpr Int128 kLargestScale = Int128{1} << 40U;

}  // namespace

Contention::Contention(const TaskSet &task_set, std::vector<GlobalUnit> &units, std::uint32_t workers)
    : task_set_(task_set), units_(units) {
  resources_.push_back({workers, false, task_set.mode == sched::Preemption::Full, DeviceId()});
  for (std::size_t d = 0; d < task_set.devices.size(); ++d) {
    const Device &device = task_set.devices[d];
    resources_.push_back({device.slots, device.queue == Device::Queue::Fifo, false, DeviceId(d)});
  }
  find_uses();
  demands_.resize(task_set.units.size());
  elsewhere_.resize(task_set.units.size());
  for (GlobalUnit &unit : units_) find_demands(unit);
  blocking_.resize(resources_.size());
  works_.resize(units_.size());
  check_sums();
}

void Contention::find_uses() {
  uses_.resize(task_set_.tasks.size());
  for (std::size_t t = 0; t < uses_.size(); ++t) {
    const CompiledTask &task = task_set_.tasks[t];
    const Duration executes = task.wcet - task.waits;
    // Each of the other stretches between waits takes at least 1 ns.
    uses_[t].push_back({executes, executes - task.wake_ups, task.wake_ups + 1});
    for (const DeviceUse &use : task.devices) uses_[t].push_back({use.service, use.longest, use.requests});
  }
}

void Contention::find_demands(GlobalUnit &unit) {
  const Unit &compiled = task_set_.units[unit.unit];
  const std::uint32_t cap = cap_of(unit);
  std::vector<Demand> &demands = demands_[unit.unit];
  demands.resize(resources_.size());
  // The longest path by one kind of time. Tasks stand in topological order.
  const auto longest = [&](auto time_of) {
    std::vector<Duration> until(task_set_.tasks.size(), 0);
    Duration most = 0;
    for (const std::uint32_t t : paths_of(compiled)) {
      Duration before = 0;
      for (const std::uint32_t p : task_set_.tasks[t].predecessors) before = std::max(before, until[p]);
      until[t] = add(before, time_of(t));
      most = std::max(most, until[t]);
    }
    return most;
  };
  for (std::size_t r = 0; r < resources_.size(); ++r) {
    Demand &demand = demands[r];
    demand = Demand{};
    std::uint32_t requests = 0;
    for (const std::uint32_t t : tasks_of(compiled)) {
      const Use &use = uses_[t][r];
      demand.work.volume = add(demand.work.volume, use.time);
      demand.ahead = add(demand.ahead, use.longest);
      demand.tasks += use.requests > 0 ? 1 : 0;
      requests += use.requests;
    }
    demand.path = longest([&](std::uint32_t t) { return uses_[t][r].time; });
    // While its max_active is reached, each end of a job can let less urgent ones start before the next one does.
    const bool can_lose_its_turn = cap > 0 && r == 0 && !resources_[r].is_instant;
    demand.requests = cap > 0 ? requests + (can_lose_its_turn ? unit.tasks : 0)
                              : static_cast<std::uint32_t>(longest(
                                    [&](std::uint32_t t) { return static_cast<Duration>(uses_[t][r].requests); }));
    demand.work.period = unit.period;
    const std::uint32_t width = std::min(resources_[r].servers, cap > 0 ? std::min(cap, demand.tasks) : demand.tasks);
    set_width(demand.work, std::max(1U, width));
  }
  elsewhere_[unit.unit] = longest([&](std::uint32_t t) { return task_set_.tasks[t].elsewhere; });
  unit.volume = demands[0].work.volume;
  unit.length = longest([&](std::uint32_t t) {
    Duration time = task_set_.tasks[t].elsewhere;
    for (const Use &use : uses_[t]) time = add(time, use.time);
    return time;
  });
}

void Contention::check_sums() {
  Duration longest = 1;
  std::uint32_t servers = 1;
  for (const Resource &resource : resources_) {
    servers = std::max(servers, resource.servers);
    make_divisible(resource.servers);
  }
  for (const GlobalUnit &unit : units_) {
    longest = std::max(longest, unit.period);
    for (const Demand &demand : demands_[unit.unit]) longest = std::max(longest, demand.work.volume);
    make_divisible(std::max(1U, cap_of(unit)));
  }
  const Int128 sum = Int128{longest} * 4 * servers;
  if (sum * static_cast<Duration>(units_.size() + 2) >= (Int128{1} << 62U) || sum >= (Int128{1} << 50U))
    why_not_ = "the times are too long for exact sums";
}

void Contention::make_divisible(std::uint32_t divisor) {
  const Duration common = std::gcd(static_cast<Duration>(scale_), static_cast<Duration>(divisor));
  const Int128 multiple = scale_ * (divisor / common);
  if (multiple > kLargestScale) {
    why_not_ = "the numbers of workers, slots and max_active have no small common multiple";
  } else {
    scale_ = multiple;
  }
}

std::uint32_t Contention::cap_of(const GlobalUnit &unit) const {
  return unit.bound > 0 ? task_set_.dags[task_set_.units[unit.unit].dag.value].max_active : 0;
}

// Less urgent work that is in progress when a job asks for the resource, and keeps its servers.
Duration Contention::blocking_at(std::size_t resource, std::size_t k) const {
  const Resource &at = resources_[resource];
  if (at.is_instant) return 0;
  Duration sum = 0;
  std::vector<Duration> longest;
  for (std::size_t u = k + 1; u < units_.size(); ++u) {
    const std::vector<std::uint32_t> &tasks = task_set_.units[units_[u].unit].tasks;
    Effort::spend(tasks.size());
    for (const std::uint32_t t : tasks) {
      const Duration one = uses_[t][resource].longest;
      // A task asks once at a time. Where urgency decides, its service began at an instant strictly before.
      if (at.is_fifo) sum = add(sum, one);
      if (one > 1) longest.push_back(one - 1);
    }
  }
  if (at.is_fifo) return sum;
  const std::size_t count = std::min<std::size_t>(longest.size(), at.servers);
  std::partial_sort(longest.begin(), longest.begin() + static_cast<std::ptrdiff_t>(count), longest.end(),
                    std::greater<>());
  for (std::size_t i = 0; i < count; ++i) sum = add(sum, longest[i]);
  return sum;
}

// The servers that the unit's other tasks keep busy while one of its jobs waits.
std::uint32_t Contention::own_divisor(std::size_t resource) const {
  const std::uint32_t servers = resources_[resource].servers;
  return cap_ > 0 ? std::min(cap_, servers) : servers;
}

// The path on which all kinds of time together delay the unit the most.
Contention::Path Contention::heaviest_path(const Unit &unit) const {
  const std::vector<Demand> &own = demands_[units_[k_].unit];
  std::vector<Int128> until(task_set_.tasks.size(), 0);
  std::vector<std::uint32_t> from(task_set_.tasks.size(), kNoGroup);
  const std::vector<std::uint32_t> &tasks = paths_of(unit);
  std::uint32_t last = tasks.front();
  for (const std::uint32_t t : tasks) {
    const CompiledTask &task = task_set_.tasks[t];
    Int128 weight = scale_ * task.elsewhere;
    if (cap_ > 0) weight -= share(task.elsewhere, cap_);
    for (std::size_t r = 0; r < resources_.size(); ++r) {
      const Use &use = uses_[t][r];
      weight += scale_ * use.time - share(use.time, own_divisor(r));
      if (cap_ == 0 && own[r].work.volume > 0) {
        weight += share(Int128{use.requests} * blocking_[r], resources_[r].servers);
      }
    }
    for (const std::uint32_t p : task.predecessors) {
      if (until[p] > until[t]) {
        until[t] = until[p];
        from[t] = p;
      }
    }
    until[t] += weight;
    if (until[t] > until[last]) last = t;
  }
  Path path{until[last], {}};
  for (std::uint32_t t = last; t != kNoGroup; t = from[t]) path.tasks.push_back(t);
  return path;
}

void Contention::open(std::size_t k) {
  k_ = k;
  const GlobalUnit &unit = units_[k];
  const Unit &compiled = task_set_.units[unit.unit];
  const std::vector<Demand> &own = demands_[unit.unit];
  cap_ = cap_of(unit);
  for (std::size_t r = 0; r < resources_.size(); ++r) {
    blocking_[r] = own[r].work.volume > 0 ? blocking_at(r, k) : 0;
  }
  apart_ = elsewhere_[unit.unit];
  together_ = heaviest_path(compiled).weight;
  if (cap_ > 0) {
    for (const std::uint32_t t : tasks_of(compiled)) together_ += share(task_set_.tasks[t].elsewhere, cap_);
  }
  for (std::size_t r = 0; r < resources_.size(); ++r) {
    apart_ = add(apart_, own[r].path);
    together_ += share(own[r].work.volume, own_divisor(r));
    if (cap_ > 0) together_ += share(Int128{own[r].requests} * blocking_[r], resources_[r].servers);
  }
}

// Finds what the units before do at the resource in the window.
Duration Contention::sum_works(std::size_t resource, Duration window) {
  const Resource &at = resources_[resource];
  const Demand &own = demands_[units_[k_].unit][resource];
  Duration sum = 0;
  Effort::spend(k_ + 1);
  for (std::size_t j = 0; j < k_; ++j) {
    Demand &other = demands_[units_[j].unit][resource];
    works_[j] = 0;
    if (other.work.volume == 0) continue;
    const Duration width = other.work.width;
    other.work.response = std::max(units_[j].response, ceil_div(other.work.volume, width));
    works_[j] = dag_work(other.work, window);
    // Who asks later than a job of the unit is served later.
    if (at.is_fifo) works_[j] = std::min(works_[j], multiply(own.requests, other.ahead));
    sum += works_[j];
  }
  return sum;
}

// Returns the most instants in which jobs of a path wait for the resource, all of whose servers are busy: the largest y
// with n y <= min(own, (tasks - 1) y) + sum min(W_j, c_j y) + blocking, found as dag_bounded() finds it.
Duration Contention::instants(std::size_t resource, Duration others) const {
  const Demand &own = demands_[units_[k_].unit][resource];
  const Duration servers = resources_[resource].servers;
  const Duration off_path = own.work.volume - own.path;
  const Duration blocked = multiply(own.requests, blocking_[resource]);
  Duration most = saturate((Int128{off_path} + others + blocked) / servers);
  while (most < kUnbounded) {
    Effort::spend(k_ + 1);
    Int128 constant = blocked;
    Duration slope = 0;
    const auto count = [&](Duration work, Duration width) {
      const bool is_whole = work <= Int128{width} * most;
      constant += is_whole ? work : 0;
      slope += is_whole ? 0 : width;
    };
    count(off_path, Duration{own.tasks} - 1);
    for (std::size_t j = 0; j < k_; ++j) count(works_[j], demands_[units_[j].unit][resource].work.width);
    if (slope >= servers || constant / (servers - slope) >= most) break;
    most = saturate(constant / (servers - slope));
  }
  return most;
}

Duration Contention::next(Duration window) {
  const std::vector<Demand> &own = demands_[units_[k_].unit];
  Int128 together = together_;
  Duration apart = apart_;
  for (std::size_t r = 0; r < resources_.size(); ++r) {
    if (own[r].work.volume == 0) continue;
    const Duration others = sum_works(r, window);
    together += share(others, resources_[r].servers);
    apart = add(apart, instants(r, others));
  }
  const Duration whole = saturate(together / scale_);
  is_apart_ = cap_ == 0 && apart <= whole;
  return is_apart_ ? apart : whole;
}

void Contention::narrow(GlobalUnit &unit, const Part *part) {
  part_ = part;
  unit.tasks = static_cast<std::uint32_t>(tasks_of(task_set_.units[unit.unit]).size());
  find_demands(unit);
}

bool Contention::respond(std::size_t k, Duration start) {
  GlobalUnit &unit = units_[k];
  if (is_hopeless(unit, resources_.front().servers)) return false;
  open(k);
  Duration window = std::max(start, unit.length);
  const bool found = least_fixed_point(unit.limit - unit.jitter, window, [this](Duration x) { return next(x); });
  unit.response = add(window, unit.jitter);
  return found;
}

ResponseBound Contention::explain(std::size_t k) {
  ResponseBound bound;
  const GlobalUnit &unit = units_[k];
  bound.response = unit.response;
  SharedTerms terms(task_set_, unit);
  if (!terms.wanted()) return bound;
  open(k);
  (void)next(unit.response - unit.jitter);
  is_apart_ ? explain_apart(terms) : explain_together(terms);
  terms.at(DeviceId());
  terms.add_jitter();
  bound.terms = terms.take();
  return bound;
}

// Each resource for itself: the most on a path, and the instants of waiting. What is tightened away is taken from the
// terms in their order.
void Contention::explain_apart(SharedTerms &terms) {
  const GlobalUnit &unit = units_[k_];
  const std::vector<Demand> &own = demands_[unit.unit];
  terms.add(Term::Kind::Suspended, unit, elsewhere_[unit.unit]);
  for (std::size_t r = 0; r < resources_.size(); ++r) {
    if (own[r].work.volume == 0) continue;
    const bool is_device = resources_[r].device.valid();
    terms.at(resources_[r].device);
    terms.add(is_device ? Term::Kind::Suspended : Term::Kind::Own, unit, own[r].path, is_device ? 0 : 1);
    const Duration waits = instants(r, sum_works(r, unit.response - unit.jitter));
    const Duration servers = resources_[r].servers;
    Duration left = multiply(waits, servers);
    const auto take = [&left](Duration amount) {
      const Duration taken = std::min(amount, left);
      left -= taken;
      return taken;
    };
    for (std::size_t j = 0; j < k_; ++j) {
      const Duration width = demands_[units_[j].unit][r].work.width;
      const Duration work = take(std::min(works_[j], multiply(width, waits)));
      terms.add_share(Term::Kind::Interference, units_[j], work, servers);
    }
    const Duration blocked = take(multiply(own[r].requests, blocking_[r]));
    terms.add_blocking(blocked, servers);
    terms.add_share(is_device ? Term::Kind::Interference : Term::Kind::Own, unit, left, servers);
  }
}

// The heaviest path, and the shares of all others.
void Contention::explain_together(SharedTerms &terms) {
  const GlobalUnit &unit = units_[k_];
  const Unit &compiled = task_set_.units[unit.unit];
  const std::vector<Demand> &own = demands_[unit.unit];
  const Path path = heaviest_path(compiled);
  Duration elsewhere = 0;
  Duration all_elsewhere = 0;
  for (const std::uint32_t t : path.tasks) elsewhere += task_set_.tasks[t].elsewhere;
  for (const std::uint32_t t : tasks_of(compiled)) all_elsewhere += task_set_.tasks[t].elsewhere;
  terms.add(Term::Kind::Suspended, unit, elsewhere);
  if (cap_ > 0) terms.add_share(Term::Kind::Own, unit, all_elsewhere - elsewhere, cap_);
  for (std::size_t r = 0; r < resources_.size(); ++r) {
    if (own[r].work.volume == 0) continue;
    const bool is_device = resources_[r].device.valid();
    terms.at(resources_[r].device);
    Duration on_path = 0;
    Duration requests = 0;
    for (const std::uint32_t t : path.tasks) {
      on_path += uses_[t][r].time;
      requests += uses_[t][r].requests;
    }
    if (cap_ > 0) requests = own[r].requests;
    const Duration servers = resources_[r].servers;
    terms.add(is_device ? Term::Kind::Suspended : Term::Kind::Own, unit, on_path, is_device ? 0 : 1);
    (void)sum_works(r, unit.response - unit.jitter);
    for (std::size_t j = 0; j < k_; ++j) terms.add_share(Term::Kind::Interference, units_[j], works_[j], servers);
    terms.add_blocking(multiply(requests, blocking_[r]), servers);
    terms.add_share(is_device ? Term::Kind::Interference : Term::Kind::Own, unit, own[r].work.volume - on_path,
                    own_divisor(r));
  }
}

}  // namespace redag::analysis::global
