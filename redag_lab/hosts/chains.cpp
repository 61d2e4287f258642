// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/chains.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "redag/base/nearest.hpp"
#include "redag/base/text.hpp"
#include "redag/model/workload.hpp"

namespace redag::hosts {
namespace {

constexpr std::size_t kMostLinks = 1000;
constexpr std::size_t kMostChains = 1000;
constexpr std::size_t kMostRemembered = std::size_t{1} << 16U;  // jobs of a task at either end of a link

class Finder {
 public:
  Finder(const MergedRun &merged, std::span<const Link> links)
      : merged_(merged), links_(links), tasks_(flatten(merged.info.workload)) {
    for (const TaskRef &task : tasks_) names_.push_back(name_of(task.id));
  }

  Result<std::vector<Chain>> run() {
    if (links_.size() > kMostLinks) {
      return make_error(fmt::format("there are {} links; at most {} are allowed", links_.size(), kMostLinks));
    }
    for (const Link &link : links_) read(link);
    if (mistakes_.empty()) {
      mark();
      for (std::size_t l = 0; l < crossings_.size(); ++l) {
        if (is_first(l)) follow({l});
      }
      check_circles();
    }
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    return std::move(chains_);
  }

 private:
  // "host.dag.task"; the merged run has "host/dag".
  [[nodiscard]] std::string name_of(TaskId id) const {
    const Host &host = merged_.hosts[merged_.host_of_task[id.value]];
    const TaskRef &task = tasks_[id.value];
    const Dag &own = host.info.workload.dags[task.dag.value - host.first_dag];
    return fmt::format("{}.{}.{}", host.name, own.name, task.task->name);
  }

  void refuse(std::size_t link, std::string message, std::string hint) {
    const Link &at = links_[link];
    mistakes_.push_back(Diagnostic{Severity::Error, at.file, at.line, at.column,
                                   fmt::format("link from '{}': {}", at.from, message), std::move(hint)});
  }

  std::optional<TaskId> task_named(std::size_t link, const std::string &name) {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found != names_.end()) return TaskId(static_cast<std::size_t>(found - names_.begin()));
    const std::vector<std::string_view> candidates(names_.begin(), names_.end());
    const std::string_view near = nearest(name, candidates);
    refuse(link, fmt::format("there is no task {}", in_quotes(name)),
           near.empty() ? "write HOST.DAG.TASK; 'redag report --json' lists the tasks of a result"
                        : fmt::format("did you mean '{}'?", near));
    return std::nullopt;
  }

  // Marks which tasks each link leads to, and those that are no end of a chain: other tasks or links take their data.
  void mark() {
    has_follower_.resize(tasks_.size(), false);
    for (const TaskRef &task : tasks_) {
      for (const std::uint32_t before : task.task->predecessors) has_follower_[sibling(task.id, before).value] = true;
    }
    for (const Crossing &crossing : crossings_) {
      has_follower_[crossing.from.value] = true;
      reached_.push_back(reached_from(crossing.to));
    }
  }

  void read(const Link &link) {
    const std::size_t index = crossings_.size();
    crossings_.push_back({.transport = link.transport});
    const std::optional<TaskId> from = task_named(index, link.from);
    const std::optional<TaskId> to = task_named(index, link.to);
    if (!from || !to) return;
    if (merged_.host_of_task[from->value] == merged_.host_of_task[to->value]) {
      return refuse(index, "it stays on one host", "a chain over hosts follows the DAGs of each host by itself");
    }
    if (!tasks_[to->value].task->predecessors.empty()) {
      return refuse(index, fmt::format("task '{}' has predecessors on its host", link.to),
                    "name the task that receives the data");
    }
    if (!targets_.insert(*to).second) {
      return refuse(index, fmt::format("task '{}' has the data of another link already", link.to),
                    "name the task that receives the data of each");
    }
    crossings_[index].from = *from;
    crossings_[index].to = *to;
  }

  // The tasks of a DAG, by their position in it.
  using Marks = std::vector<bool>;

  [[nodiscard]] TaskId sibling(TaskId task, std::uint32_t index) const {
    return TaskId(task.value - tasks_[task.value].index + index);
  }
  [[nodiscard]] const Dag &dag_of(TaskId task) const {
    return merged_.info.workload.dags[tasks_[task.value].dag.value];
  }

  // The tasks of its DAG that the data of `task` reach, with itself.
  [[nodiscard]] Marks reached_from(TaskId task) const {
    const Dag &dag = dag_of(task);
    Marks reached(dag.tasks.size(), false);
    const std::vector<std::uint32_t> rank = topological_ranks(dag);
    std::vector<std::uint32_t> order(rank.size());
    for (std::uint32_t i = 0; i < rank.size(); ++i) order[rank[i]] = i;
    reached[tasks_[task.value].index] = true;
    for (const std::uint32_t i : order) {
      for (const std::uint32_t before : dag.tasks[i].predecessors) reached[i] = reached[i] || reached[before];
    }
    return reached;
  }

  [[nodiscard]] bool follows(std::size_t next, std::size_t link) const {
    const TaskId from = crossings_[next].from;
    return tasks_[from.value].dag == tasks_[crossings_[link].to.value].dag && reached_[link][tasks_[from.value].index];
  }
  [[nodiscard]] bool is_first(std::size_t link) const {
    for (std::size_t before = 0; before < crossings_.size(); ++before) {
      if (follows(link, before)) return false;
    }
    return true;
  }

  void follow(std::vector<std::size_t> path) {
    if (chains_.size() >= kMostChains) return;
    const std::size_t last = path.back();
    used_.insert(last);
    for (std::size_t next = 0; next < crossings_.size(); ++next) {
      if (!follows(next, last)) continue;
      if (std::find(path.begin(), path.end(), next) != path.end()) return refuse_circle(next);
      if (!check_sources(last, crossings_[next].from)) return;
      std::vector<std::size_t> longer = path;
      longer.push_back(next);
      follow(std::move(longer));
    }
    for (std::uint32_t i = 0; i < reached_[last].size(); ++i) {
      const TaskId end = sibling(crossings_[last].to, i);
      if (!reached_[last][i] || has_follower_[end.value]) continue;
      if (!check_sources(last, end)) return;
      add(path, end);
    }
    if (chains_.size() >= kMostChains) {
      refuse(last, fmt::format("the links make more than {} chains", kMostChains), "merge fewer links at a time");
    }
  }

  // Links in a circle have no first one.
  void check_circles() {
    for (std::size_t l = 0; l < crossings_.size() && mistakes_.empty(); ++l) {
      if (!used_.contains(l)) refuse_circle(l);
    }
  }
  void refuse_circle(std::size_t link) {
    refuse(link, "it and further links form a circle", "leave out the link that goes back");
  }

  // A job knows the earliest release whose data it carries. It is that of the link only if there is no other source.
  bool check_sources(std::size_t link, TaskId end) {
    const Dag &dag = dag_of(end);
    Marks seen(dag.tasks.size(), false);
    std::vector<std::uint32_t> open = {tasks_[end.value].index};
    while (!open.empty()) {
      const std::uint32_t i = open.back();
      open.pop_back();
      if (seen[i]) continue;
      seen[i] = true;
      const std::vector<std::uint32_t> &before = dag.tasks[i].predecessors;
      open.insert(open.end(), before.begin(), before.end());
      const TaskId task = sibling(end, i);
      if (!before.empty() || task == crossings_[link].to) continue;
      refuse(link,
             fmt::format("task '{}' has data of '{}', too, and does not record whose data it waited for",
                         names_[end.value], names_[task.value]),
             "give the data of the link a DAG of their own");
      return false;
    }
    return true;
  }

  void add(const std::vector<std::size_t> &path, TaskId sink) {
    Chain chain;
    for (const std::size_t link : path) {
      chain.links.push_back(crossings_[link]);
      chain.name += names_[crossings_[link].from.value] + " -> ";
      if (crossings_[link].to != sink || link != path.back()) chain.name += names_[crossings_[link].to.value] + " -> ";
    }
    chain.name += names_[sink.value];
    chain.sink = sink;
    const TaskRef &task = tasks_[sink.value];
    const Dag &dag = merged_.info.workload.dags[task.dag.value];
    chain.deadline = dag.deadline;
    if (chain.deadline == 0 && sink == chain.links.back().to) chain.deadline = task.task->deadline;
    chains_.push_back(std::move(chain));
  }

  const MergedRun &merged_;
  std::span<const Link> links_;
  std::vector<TaskRef> tasks_;
  std::vector<std::string> names_;  // by TaskId
  std::vector<Crossing> crossings_;
  std::vector<Marks> reached_;  // by link: what its target's data reach
  Marks has_follower_;          // by TaskId
  std::set<TaskId> targets_;
  std::set<std::size_t> used_;
  std::vector<Chain> chains_;
  Diagnostics mistakes_;
};

// Keeps `all` sorted by `key`. A new value belongs near the end.
template <class Value, class Key>
void remember(std::deque<Value> &all, const Value &value, Key key) {
  auto at = all.end();
  while (at != all.begin() && key(*(at - 1)) > key(value)) --at;
  all.insert(at, value);
  if (all.size() > kMostRemembered) all.pop_front();
}

}  // namespace

Result<Link> parse_link(std::string_view text) {
  const std::size_t first = text.find(',');
  const std::size_t last = text.rfind(',');
  constexpr const char *kForm = "write FROM,TO,TRANSPORT: vision.camera.detect,drive.avoid.obstacles,500us";
  if (first == std::string_view::npos || first == last || first == 0 || last == first + 1) {
    return make_error(fmt::format("{} is no link", in_quotes(text)), kForm);
  }
  const Result<Duration> transport = parse_duration(text.substr(last + 1));
  if (!transport || *transport < 0) {
    return make_error(fmt::format("{} is no longest transport time of a link", in_quotes(text.substr(last + 1))),
                      kForm);
  }
  Link link;
  link.from = text.substr(0, first);
  link.to = text.substr(first + 1, last - first - 1);
  link.transport = *transport;
  return link;
}

Result<std::vector<Chain>> find_chains(const MergedRun &merged, std::span<const Link> links) {
  return Finder(merged, links).run();
}

const char *to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::Met: return "met";
    case Verdict::Missed: return "missed";
    case Verdict::Unknown: return "unknown";
  }
  return "?";
}

Verdict judge(const Interval &latency, Duration deadline) {
  if (latency.high <= deadline) return Verdict::Met;
  return latency.low > deadline ? Verdict::Missed : Verdict::Unknown;
}

ChainWatch::ChainWatch(const MergedRun &merged, std::vector<Chain> chains)
    : merged_(merged),
      chains_(std::move(chains)),
      figures_(chains_.size()),
      memory_(merged.info.workload.task_count()),
      folder_(merged.info.workload) {
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    for (const Crossing &link : chains_[c].links) {
      memory_[link.from.value].is_source = true;
      memory_[link.to.value].is_target = true;
    }
    memory_[chains_[c].sink.value].sink_of.push_back(static_cast<std::uint32_t>(c));
  }
  // A job's end is measured before it is reported; the rest is what two clocks can be apart.
  delay_ = kSecond;
  for (const Host &host : merged.hosts) delay_ += 2 * host.clock.within();
}

void ChainWatch::add(std::span<const JobEvent> events) {
  if (chains_.empty() || events.empty()) return;
  folder_.add(events);
  folder_.drain_ended([this](const metrics::JobRecord &job) { take(job); });
  while (!waiting_.empty() && waiting_.front().finish + delay_ < events.back().time) {
    resolve(waiting_.front());
    waiting_.pop_front();
  }
}

void ChainWatch::finish() {
  for (const Waiting &waiting : waiting_) resolve(waiting);
  waiting_.clear();
}

void ChainWatch::take(const metrics::JobRecord &job) {
  if (job.outcome != metrics::JobOutcome::Finished) return;
  Memory &memory = memory_[job.task.value];
  if (memory.is_target) {
    remember(memory.targets, Target{job.release, job.seen}, [](const Target &target) { return target.release; });
  }
  if (memory.is_source) {
    remember(memory.sources, Source{job.finish, job.origin}, [](const Source &source) { return source.finish; });
  }
  for (const std::uint32_t chain : memory.sink_of) waiting_.push_back({chain, job.number, job.finish, job.origin});
}

void ChainWatch::resolve(const Waiting &waiting) {
  const Chain &chain = chains_[waiting.chain];
  ChainFigures &figures = figures_[waiting.chain];
  Origin origin;
  switch (trace_back(chain, chain.links.size() - 1, waiting.origin, origin)) {
    case Trace::BeforeRun: return;
    case Trace::None: ++figures.unmatched; return;
    case Trace::Found: break;
  }
  const Host &first = host_of(chain.links.front().from);
  const Host &last = host_of(chain.sink);
  // A source is released before its answer, whatever the clocks say.
  const Interval latency{std::max<Duration>(time_between(first, origin.times.high, last, waiting.finish).low, 0),
                         std::max<Duration>(time_between(first, origin.times.low, last, waiting.finish).high, 0)};
  count(chain, figures, Answer{waiting.job, waiting.finish, latency, origin.is_ambiguous});
}

// Finds the jobs that can have released the job of the link's target whose nominal release is `origin`, and in turn
// theirs.
ChainWatch::Trace ChainWatch::trace_back(const Chain &chain, std::size_t link, Time origin, Origin &out) const {
  const Crossing &crossing = chain.links[link];
  const std::deque<Target> &targets = memory_[crossing.to.value].targets;
  const auto target =
      std::find_if(targets.rbegin(), targets.rend(), [origin](const Target &each) { return each.release <= origin; });
  if (target == targets.rend() || target->release != origin) return Trace::None;
  const Host &from = host_of(crossing.from);
  const Host &to = host_of(crossing.to);
  const Duration slack = from.clock.within() + to.clock.within();
  bool is_found = false;
  bool is_before = target->release - crossing.transport - slack < from.info.start + from.shift;
  const std::deque<Source> &sources = memory_[crossing.from.value].sources;
  for (auto source = sources.rbegin(); source != sources.rend(); ++source) {
    if (time_between(from, source->finish, to, target->seen).high < 0) continue;                     // it ended later
    if (target->release - source->finish - crossing.transport > slack) break;                        // all others, too
    if (time_between(from, source->finish, to, target->release).low > crossing.transport) continue;  // long before
    Origin found{{source->origin, source->origin}, false};
    if (link > 0) {
      const Trace traced = trace_back(chain, link - 1, source->origin, found);
      is_before = is_before || traced == Trace::BeforeRun;
      if (traced != Trace::Found) continue;
    }
    out.is_ambiguous = is_found || found.is_ambiguous;
    out.times = is_found
                    ? Interval{std::min(out.times.low, found.times.low), std::max(out.times.high, found.times.high)}
                    : found.times;
    is_found = true;
  }
  if (is_before) return Trace::BeforeRun;
  return is_found ? Trace::Found : Trace::None;
}

void ChainWatch::count(const Chain &chain, ChainFigures &figures, const Answer &answer) {
  const Interval &latency = answer.latency;
  if (figures.answers == 0 || latency.low < figures.shortest.low) figures.shortest = latency;
  if (figures.answers == 0 || latency.high > figures.longest.high) figures.longest = latency;
  ++figures.answers;
  figures.widest = std::max(figures.widest, latency.width());
  if (answer.is_ambiguous) ++figures.ambiguous;
  if (chain.deadline > 0) ++figures.verdicts[static_cast<std::size_t>(judge(latency, chain.deadline))];
  if (figures.first.size() < ChainFigures::kMostKept) figures.first.push_back(latency);
  const auto longer = [](const Answer &a, const Answer &b) { return a.latency.high > b.latency.high; };
  std::vector<Answer> &worst = figures.worst;
  if (worst.size() == ChainFigures::kMostWorst && !longer(answer, worst.back())) return;
  worst.insert(std::upper_bound(worst.begin(), worst.end(), answer, longer), answer);
  if (worst.size() > ChainFigures::kMostWorst) worst.pop_back();
}

}  // namespace redag::hosts
