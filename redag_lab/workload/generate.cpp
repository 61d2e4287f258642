// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/workload/generate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/loader/validate.hpp"
#include "redag_lab/workload/generate_utilization.hpp"

namespace redag::lab {
namespace {

struct Share {
  Duration period;
  int weight;
};

// Rates at which ROS nodes commonly publish and their timers run. The weights are our choice, not a measurement.
constexpr std::array kRobot = {
    Share{kSecond / 1000, 2}, Share{kSecond / 500, 3}, Share{kSecond / 200, 8}, Share{kSecond / 100, 15},
    Share{kSecond / 50, 20},  Share{kSecond / 30, 15}, Share{kSecond / 20, 12}, Share{kSecond / 10, 15},
    Share{kSecond / 5, 5},    Share{kSecond, 5},
};

Duration draw_robot_period(Rng &rng) {
  const int total =
      std::accumulate(kRobot.begin(), kRobot.end(), 0, [](int n, const Share &s) { return n + s.weight; });
  std::int64_t drawn = rng.uniform(0, total - 1);
  for (const Share &share : kRobot) {
    drawn -= share.weight;
    if (drawn < 0) return share.period;
  }
  return kRobot.back().period;
}

double uniform(double low, double high, Rng &rng) { return low + (high - low) * rng.uniform01(); }

std::uint32_t uniform(std::uint32_t low, std::uint32_t high, Rng &rng) {
  return static_cast<std::uint32_t>(rng.uniform(low, high));
}

/// Builds one workload. Each part draws from a random stream of its own. Changing one option (jitter, say) therefore
/// leaves everything else as it was.
class Generator {
 public:
  Generator(const GenerateOptions &options, std::uint64_t seed) : o_(options), seed_(seed) {}

  Result<Workload> run() {
    workload_.name = fmt::format("generated_{}", seed_);
    workload_.platform = Platform{o_.workers, o_.preemption};
    workload_.policy = o_.policy;
    workload_.dags.resize(o_.dags);
    for (std::uint32_t d = 0; d < o_.dags; ++d) {
      dag_ = d;
      Dag &dag = workload_.dags[d];
      dag.name = fmt::format("dag{}", d);
      Rng rng = stream(Stream::Size);
      dag.tasks.resize(uniform(o_.min_tasks, o_.max_tasks, rng));
      for (std::size_t i = 0; i < dag.tasks.size(); ++i) dag.tasks[i].name = fmt::format("t{}", i);
      draw_edges(dag);
      draw_activation(dag);
      draw_periods(dag);
      draw_options(dag);
    }
    const auto utilizations = draw_utilizations();
    if (!utilizations) {
      return make_error("no utilizations within the bound were drawn in the allowed attempts",
                        "use more tasks, or less utilization");
    }
    std::size_t next = 0;
    for (std::uint32_t d = 0; d < o_.dags; ++d) {
      dag_ = d;
      draw_demands(workload_.dags[d], std::span<const double>(*utilizations).subspan(next));
      next += workload_.dags[d].tasks.size();
    }
    REDAG_CHECK(!has_errors(validate(workload_)), "a generated workload is valid");
    return std::move(workload_);
  }

 private:
  enum class Stream : std::uint8_t {
    Size,
    Edges,
    Activation,
    Periods,
    Offsets,
    Jitter,
    Options,
    Demand,
    Deadlines,
    Load
  };

  [[nodiscard]] Rng stream(Stream stream) const { return Rng::stream(seed_, static_cast<std::uint64_t>(stream), dag_); }

  // Tasks are numbered in a topological order: every edge goes from a smaller to a larger position.
  void draw_edges(Dag &dag) {
    Rng rng = stream(Stream::Edges);
    const auto count = static_cast<std::uint32_t>(dag.tasks.size());
    switch (o_.shape) {
      case DagShape::Independent: return;
      case DagShape::Layered: return draw_layers(dag, rng);
      case DagShape::Chain:
        for (std::uint32_t i = 1; i < count; ++i) dag.tasks[i].predecessors = {i - 1};
        return;
      case DagShape::ForkJoin:
        for (std::uint32_t i = 1; i + 1 < count; ++i) {
          dag.tasks[i].predecessors = {0};
          dag.tasks[count - 1].predecessors.push_back(i);
        }
        if (count == 2) dag.tasks[1].predecessors = {0};
        return;
      case DagShape::ErdosRenyi:
        for (std::uint32_t i = 1; i < count; ++i) {
          for (std::uint32_t p = 0; p < i; ++p) {
            if (rng.uniform01() < o_.edge_probability) dag.tasks[i].predecessors.push_back(p);
          }
        }
        return;
    }
  }

  // Draws a layer's width, sqrt(n) tasks on average. Each task gets one predecessor of the previous layer; further ones
  // are drawn.
  static std::uint32_t layer_width(std::uint32_t count, Rng &rng) {
    const auto mean = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(count)));
    return uniform(std::uint32_t{1}, std::max<std::uint32_t>(1, 2 * mean - 1), rng);
  }

  void draw_layers(Dag &dag, Rng &rng) const {
    const auto count = static_cast<std::uint32_t>(dag.tasks.size());
    std::uint32_t before = 0;  // the previous layer is [before, begin)
    std::uint32_t begin = std::min(count, layer_width(count, rng));
    while (begin < count) {
      const std::uint32_t end = std::min(count, begin + layer_width(count, rng));
      for (std::uint32_t i = begin; i < end; ++i) {
        const std::uint32_t certain = uniform(before, begin - 1, rng);
        for (std::uint32_t p = before; p < begin; ++p) {
          if (p == certain || rng.uniform01() < o_.edge_probability) dag.tasks[i].predecessors.push_back(p);
        }
      }
      before = begin;
      begin = end;
    }
  }

  void draw_activation(Dag &dag) {
    Rng rng = stream(Stream::Activation);
    for (Task &task : dag.tasks) {
      const bool data = rng.uniform01() < o_.data_share;
      if (data && !task.predecessors.empty()) task.activation = Activation::Data;
    }
  }

  Duration draw_period(Rng &rng) const {
    switch (o_.periods) {
      case PeriodModel::Robot: return draw_robot_period(rng);
      case PeriodModel::Harmonic: {
        std::int64_t doublings = 0;
        while ((o_.period_min << (doublings + 1)) <= o_.period_max) ++doublings;
        return o_.period_min << rng.uniform(0, doublings);
      }
      case PeriodModel::LogUniform: break;
    }
    // The period is uniform in the logarithm over [min, max + granularity) and rounded down. The last multiple thereby
    // gets its full share.
    const Duration g = o_.period_granularity;
    const double low = std::log(static_cast<double>(o_.period_min));
    const double high = std::log(static_cast<double>(o_.period_max + g));
    const auto drawn = static_cast<Duration>(std::exp(uniform(low, high, rng)));
    const Duration first = (o_.period_min + g - 1) / g * g;
    const Duration last = std::max(first, o_.period_max / g * g);
    return std::clamp(drawn / g * g, first, last);
  }

  void draw_periods(Dag &dag) {
    Rng periods = stream(Stream::Periods);
    Rng offsets = stream(Stream::Offsets);
    Rng jitters = stream(Stream::Jitter);
    const Duration shared = draw_period(periods);
    const double shared_phase = offsets.uniform01();
    for (Task &task : dag.tasks) {
      if (task.activation == Activation::Data) continue;
      const bool own = o_.rates == RateScope::PerTask;
      task.period = own ? draw_period(periods) : shared;
      const double phase = own ? offsets.uniform01() : shared_phase;
      if (o_.offsets) task.offset = static_cast<Duration>(phase * static_cast<double>(task.period));
      const auto most = static_cast<Duration>(o_.jitter * static_cast<double>(task.period));
      task.jitter = std::min(task.period, jitters.uniform(0, most));
    }
    inherit_periods(dag);
    for (Task &task : dag.tasks) task.deadline = 0;  // drawn once the wcet is known
  }

  void draw_options(Dag &dag) {
    Rng rng = stream(Stream::Options);
    dag.max_active = uniform(o_.max_active_min, o_.max_active_max, rng);
    rng.uniform01();  // not used; a draw less would change the workloads of every seed
    for (Task &task : dag.tasks) {
      if (rng.uniform01() < o_.group_share) task.group = fmt::format("g{}", rng.uniform(0, o_.groups - 1));
      if (rng.uniform01() < o_.queue_share) {
        task.overrun = Overrun::Queue;
        task.queue_depth = uniform(std::uint32_t{1}, o_.queue_depth, rng);
      }
      if (o_.policy == PolicyKind::Fixed) task.priority = static_cast<int>(rng.uniform(0, 99));
    }
  }

  std::optional<std::vector<double>> draw_utilizations() {
    dag_ = 0;
    Rng rng = stream(Stream::Load);
    return drs(o_.utilization, std::vector<double>(workload_.task_count(), o_.max_task_utilization), rng);
  }

  void draw_demands(Dag &dag, std::span<const double> utilizations) {
    Rng demands = stream(Stream::Demand);
    Rng deadlines = stream(Stream::Deadlines);
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
      Task &task = dag.tasks[i];
      const auto period = static_cast<double>(task.period);
      task.wcet = std::clamp<Duration>(std::llround(utilizations[i] * period), 1, task.period);
      const double ratio = uniform(o_.bcet_min, o_.bcet_max, demands);
      if (ratio < 1) {
        task.bcet = std::min(task.wcet, static_cast<Duration>(ratio * static_cast<double>(task.wcet)));
        task.execution.kind = ExecutionTime::Kind::Uniform;
      }
      const double scale = uniform(o_.deadline_min, o_.deadline_max, deadlines);
      task.deadline = std::max(task.wcet, static_cast<Duration>(std::llround(scale * period)));
    }
  }

  const GenerateOptions &o_;
  std::uint64_t seed_;
  std::uint32_t dag_ = 0;
  Workload workload_;
};

}  // namespace

Diagnostics find_mistakes(const GenerateOptions &o) {
  Diagnostics mistakes;
  const auto require = [&](bool kept, std::string message) {
    if (!kept) mistakes.push_back(Diagnostic{Severity::Error, {}, 0, 0, std::move(message), {}});
  };
  const auto require_share = [&](const char *name, double value) {
    require(value >= 0 && value <= 1, fmt::format("{} must be from 0 to 1, not {}", name, value));
  };
  require(o.dags >= 1, "dags must be at least 1");
  require(o.min_tasks >= 1 && o.min_tasks <= o.max_tasks,
          "min_tasks to max_tasks must be a range that starts at 1 or more");
  require(std::uint64_t{o.dags} * o.max_tasks <= kMaxTasks,
          fmt::format("dags * max_tasks must be at most {}", kMaxTasks));
  require(o.workers >= 1 && o.workers <= kMaxWorkers, fmt::format("workers must be from 1 to {}", kMaxWorkers));
  require(o.preemption != PreemptionMode::Os || is_static(o.policy), "preemption 'os' needs a static policy");
  require(o.utilization > 0 && std::isfinite(o.utilization), "utilization must be greater than zero");
  require(o.max_task_utilization > 0 && o.max_task_utilization <= 1, "max_task_utilization must be in (0, 1]");
  require(o.utilization <= o.max_task_utilization * o.dags * o.min_tasks,
          fmt::format("{} DAGs of {} tasks with a utilization of at most {} each do not reach utilization {}", o.dags,
                      o.min_tasks, o.max_task_utilization, o.utilization));
  require(o.period_granularity >= 1 && o.period_min >= o.period_granularity, "period_min is below period_granularity");
  require(o.period_min <= o.period_max && o.period_max <= kMaxDuration / 4, "period_min to period_max must be a range");
  require(o.deadline_min > 0 && o.deadline_min <= o.deadline_max && o.deadline_max <= 4,
          "deadline_min to deadline_max must be a range in (0, 4]");
  require(o.bcet_min >= 0 && o.bcet_min <= o.bcet_max && o.bcet_max <= 1,
          "bcet_min to bcet_max must be a range in [0, 1]");
  require(o.max_active_min <= o.max_active_max, "max_active_min to max_active_max must be a range");
  require(o.group_share == 0 || o.groups > 0, "group_share needs at least one group");
  require(o.queue_depth >= 1 && o.queue_depth <= kMaxQueueDepth, "queue_depth is out of range");
  require_share("edge_probability", o.edge_probability);
  require_share("data_share", o.data_share);
  require_share("jitter", o.jitter);
  require_share("group_share", o.group_share);
  require_share("queue_share", o.queue_share);
  return mistakes;
}

Result<Workload> generate(const GenerateOptions &options, std::uint64_t seed) {
  Diagnostics mistakes = find_mistakes(options);
  if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
  return Generator(options, seed).run();
}

const char *to_string(PeriodModel value) {
  switch (value) {
    case PeriodModel::LogUniform: return "log_uniform";
    case PeriodModel::Harmonic: return "harmonic";
    case PeriodModel::Robot: return "robot";
  }
  return "?";
}

const char *to_string(DagShape value) {
  switch (value) {
    case DagShape::Layered: return "layered";
    case DagShape::ErdosRenyi: return "erdos_renyi";
    case DagShape::ForkJoin: return "fork_join";
    case DagShape::Chain: return "chain";
    case DagShape::Independent: return "independent";
  }
  return "?";
}

}  // namespace redag::lab
