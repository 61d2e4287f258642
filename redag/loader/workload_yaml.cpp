// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/workload_yaml.hpp"

#include <algorithm>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "redag/loader/fields.hpp"
#include "redag/loader/hyperperiod_warning.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml_node.hpp"
#include "redag/loader/workload_yaml_tree.hpp"
#include "redag/loader/workload_yaml_values.hpp"

namespace redag {
namespace {

using yaml::Node;

/// A map of the file, and which of its values could not be read. Findings that depend on those are not reported.
struct Part {
  const Node *node = nullptr;
  FieldSet broken;
};

struct TaskPart : Part {
  std::vector<const Node *> edges;  // parallel to Task::predecessors
};

struct DagPart : Part {
  std::vector<TaskPart> tasks;
};

const Node *find(const Part &part, Field field) { return yaml::find(*part.node, to_string(field)); }

/// Turns one file into a workload: reads the tree, gathers all mistakes, then validates the whole by validate.hpp.
class Reader : private yaml::ValueReader {
 public:
  Reader(const Node &root, std::string file, LoadOptions options) : ValueReader(std::move(file)), options_(options) {
    root_.node = &root;
  }

  Result<LoadedWorkload> run() {
    read_top();
    if (structure_known_) {
      inherit();
      std::vector<Finding> findings = find_mistakes(workload_, options_);
      const auto states_rate = [this](const TaskRef &ref) { return is_rate(ref.dag, ref.index); };
      if (auto warning = hyperperiod_warning(workload_, states_rate)) findings.push_back(*std::move(warning));
      report(std::move(findings));
    }
    Diagnostics found = take_diagnostics();
    if (has_errors(found)) return tl::unexpected<Diagnostics>(std::move(found));
    const bool states_workers = platform_.node != nullptr &&
                                (find(platform_, Field::Workers) != nullptr || find(platform_, Field::Cpus) != nullptr);
    return LoadedWorkload{std::move(workload_), std::move(found), states_workers};
  }

 private:
  // --- keys of a part ---

  /// Reads the fields of a part that stand alone. Returns false if the part is no map.
  template <const auto &rows, class Owner>
  bool take_fields(Part &part, std::string_view what, Owner &owner) {
    const bool is_map = check_map(*part.node, what, fields::keys_of<rows>());
    part.broken |= is_map ? ValueReader::take_fields(*part.node, owner, rows) : fields::all_of(rows);
    return is_map;
  }

  /// Reads a joint field by its type. Notes a failure in `part`.
  template <class T>
  void take(Part &part, Field field, T &out, std::int64_t least = 1, std::int64_t most = kMaxDuration) {
    if (!ValueReader::take(*part.node, to_string(field), out, least, most)) part.broken |= field;
  }

  /// Returns the items of a list. The list may be absent or null: validate.hpp then reports what is missing.
  const std::vector<Node> *take_list(Part &part, Field field) {
    const Node *node = find(part, field);
    if (node == nullptr || node->kind == Node::Kind::Null) return nullptr;
    if (node->kind == Node::Kind::Sequence) return &node->children;
    wrong_type(*node, to_string(field), "a list");
    part.broken |= field;
    return nullptr;
  }

  // --- the parts of a workload ---

  void read_top() {
    if (root_.node->kind == Node::Kind::Null) {
      error(Node{}, "the file has no workload",
            "a workload needs at least one DAG with one task, see docs/workload_format.md");
      return;
    }
    if (!take_fields<fields::kWorkload>(root_, "a workload", workload_)) return;
    structure_known_ = true;
    read_platform();
    const std::vector<Node> *dags = take_list(root_, Field::Dags);
    if (dags == nullptr) return;
    workload_.dags.resize(dags->size());
    dags_.resize(dags->size());
    for (std::size_t d = 0; d < dags->size(); ++d) read_dag((*dags)[d], workload_.dags[d], dags_[d]);
  }

  void read_platform() {
    workload_.platform.workers = options_.default_workers;
    platform_.node = find(root_, Field::Platform);
    if (platform_.node == nullptr) return;
    if (take_fields<fields::kPlatform>(platform_, "platform", workload_.platform)) {
      take_workers(platform_, workload_.platform.workers, workload_.platform.cpus);
      read_clusters();
    }
    root_.broken |= platform_.broken;
  }

  /// Reads the number of workers and their processors. Processors alone mean one worker for each.
  void take_workers(Part &part, std::uint32_t &workers, std::vector<int> &cpus) {
    take(part, Field::Cpus, cpus);
    if (!cpus.empty()) workers = static_cast<std::uint32_t>(cpus.size());
    if (part.broken.intersects(Field::Cpus)) part.broken |= Field::Workers;
    take(part, Field::Workers, workers, 1, kMaxWorkers);
  }

  void read_clusters() {
    const std::vector<Node> *nodes = take_list(platform_, Field::Clusters);
    if (nodes == nullptr) return;
    for (const Field field : {Field::Workers, Field::Cpus}) {
      const Node *given = find(platform_, field);
      if (given == nullptr) continue;
      error(*given, fmt::format("platform has both '{}' and 'clusters'", to_string(field)),
            fmt::format("each cluster has {} of its own: remove '{}:' from the platform", to_string(field),
                        to_string(field)));
      platform_.broken |= field;
    }
    if (nodes->empty()) error(*find(platform_, Field::Clusters), "clusters is an empty list", "remove 'clusters:'");
    std::vector<Cluster> &clusters = workload_.platform.clusters;
    std::uint64_t workers = 0;
    for (const Node &node : *nodes) {
      Part part{&node, {}};
      Cluster &cluster = clusters.emplace_back();
      if (take_fields<fields::kCluster>(part, "a cluster", cluster)) take_workers(part, cluster.workers, cluster.cpus);
      workers += cluster.workers;
      if (part.broken.intersects(fields::all_of(fields::kCluster))) platform_.broken |= Field::Clusters;
    }
    if (!clusters.empty()) workload_.platform.workers = static_cast<std::uint32_t>(workers);
  }

  void read_dag(const Node &node, Dag &dag, DagPart &part) {
    part.node = &node;
    if (!take_fields<fields::kDag>(part, "a DAG", dag)) return;
    Duration period = 0;
    take_own_period(part, period, fmt::format("DAG '{}'", dag.name));
    const std::vector<Node> *tasks = take_list(part, Field::Tasks);
    if (tasks == nullptr) return;
    dag.tasks.resize(tasks->size());
    part.tasks.resize(tasks->size());
    for (std::size_t i = 0; i < tasks->size(); ++i) {
      dag.tasks[i].criticality = dag.criticality;
      read_task((*tasks)[i], dag.tasks[i], part.tasks[i]);
      take_period(dag.tasks[i], part.tasks[i], period, part.broken);
    }
    read_edges(dag, part);
  }

  void read_task(const Node &node, Task &task, TaskPart &part) {
    part.node = &node;
    if (!take_fields<fields::kTask>(part, "a task", task)) return;
    take_wcet(task, part);
    const Node *offset = find(part, Field::Offset);
    if (offset != nullptr && offset->is(kAnyOffset)) {
      task.phase = Phase::Unknown;
    } else {
      take(part, Field::Offset, task.offset, 0);
    }
    if (const Node *groups = find(part, Field::Group)) {
      const std::optional<std::string> group = group_of(*groups);
      task.group = group.value_or("");
      if (!group) part.broken |= Field::Group;
    }
    take_criticality(task, part);
    take_activation(task, part);
    take_overrun(task, part);
    if (find(part, Field::Bcet) != nullptr && find(part, Field::Execution) == nullptr) {
      task.execution.kind = ExecutionTime::Kind::Uniform;
    }
  }

  /// A list joins its groups: no two jobs of any of them overlap, and none waits for one while it holds another.
  std::optional<std::string> group_of(const Node &node) {
    const std::string_view key = to_string(Field::Group);
    if (node.kind != Node::Kind::Sequence) return text(node, key);
    if (node.children.empty()) {
      return error(node, "group is an empty list", "name one group or several, or leave it out");
    }
    std::optional<std::string> first;
    for (const Node &item : node.children) {
      const std::optional<std::string> name = text(item, key);
      if (!name) return std::nullopt;
      if (!first) first = name;
      if (joined(*name) != joined(*first)) groups_[joined(*name)] = joined(*first);
    }
    return first;
  }
  std::string joined(std::string name) {
    for (auto at = groups_.find(name); at != groups_.end(); at = groups_.find(name)) {
      if (const auto next = groups_.find(at->second); next != groups_.end()) at->second = next->second;
      name = at->second;
    }
    return name;
  }

  void take_activation(Task &task, TaskPart &part) {
    const std::string_view timer = to_string(Activation::Timer);
    const std::string_view data = to_string(Activation::Data);
    const Node *node = find(part, Field::Activation);
    if (node == nullptr || node->is(timer)) return;
    if (node->is(data)) {
      task.activation = Activation::Data;
    } else if (node->is(kEventActivation)) {
      task.phase = Phase::Event;
    } else {
      unknown_choice(*node, to_string(Field::Activation), {timer, data, kEventActivation});
      part.broken |= Field::Activation;
    }
  }

  /// The scheduler only uses the DAG's criticality. Warns if a task has another one, which would have no effect.
  void take_criticality(Task &task, TaskPart &part) {
    const Criticality of_dag = task.criticality;
    take(part, Field::Criticality, task.criticality);
    if (task.criticality == of_dag) return;
    const Node &at = *find(part, Field::Criticality);
    diagnostics_.push_back(Diagnostic{Severity::Warning, file_, at.line, at.column,
                                      fmt::format("criticality {} of task '{}' has no effect, because its DAG has {}",
                                                  to_string(task.criticality), task.name, to_string(of_dag)),
                                      "set the criticality of the DAG, or move the task to a DAG of its own"});
  }

  void take_wcet(Task &task, TaskPart &part) {
    if (const Node *segments = find(part, Field::Segments)) return take_segments(*segments, task, part);
    const bool is_callback = find(part, Field::Callback) != nullptr;
    const bool may_lack = is_callback && options_.wcet_optional;
    take(part, Field::Wcet, task.wcet, may_lack ? 1 : 0);
    if (may_lack || find(part, Field::Wcet) != nullptr) return;
    error(*part.node, fmt::format("task '{}' has no wcet", task.name),
          is_callback
              ? "run the node with learning and save the measured value, or add 'wcet:', the worst-case execution time"
              : "add 'wcet:', the worst-case execution time");
    part.broken |= Field::Wcet;
  }

  void take_segments(const Node &node, Task &task, TaskPart &part) {
    if (const Node *wcet = find(part, Field::Wcet)) {
      error(*wcet, fmt::format("task '{}' has both 'wcet' and 'segments'", task.name),
            "its wcet is the sum of its cpu segments: remove 'wcet:'");
      part.broken |= Field::Wcet;
    }
    // Without the devices, an unknown name would be a second mistake.
    std::optional<Segments> read;
    if (!platform_.broken.intersects(Field::Devices)) read = segments(node, workload_.platform.devices);
    if (!read) {
      part.broken |= FieldSet(Field::Segments) | Field::Wcet;
      return;
    }
    task.wcet = read->wcet;
    task.waits = std::move(read->waits);
  }

  /// Returns what states the period of this DAG or task itself: `period` or `rate`; null if nothing does.
  static const Node *own_period(const Part &part) {
    const Node *period = find(part, Field::Period);
    return period != nullptr ? period : find(part, Field::Rate);
  }

  /// True if the period of a task follows from a rate, which the task or its DAG states.
  [[nodiscard]] bool is_rate(DagId dag, std::uint32_t task) const {
    const Node *own = own_period(dags_[dag.value].tasks[task]);
    const Part &holder = own != nullptr ? static_cast<const Part &>(dags_[dag.value].tasks[task]) : dags_[dag.value];
    return find(holder, Field::Rate) != nullptr;
  }

  void take_own_period(Part &part, Duration &out, const std::string &whose) {
    const Node *rate = find(part, Field::Rate);
    const Node *period = find(part, Field::Period);
    if (rate != nullptr && period != nullptr) {
      error(*rate, fmt::format("{} has both 'period' and 'rate'", whose), "remove one of them");
      part.broken |= Field::Period;
    } else if (rate != nullptr) {
      const std::optional<Duration> read = ValueReader::rate(*rate, to_string(Field::Rate));
      if (!read) part.broken |= Field::Rate | Field::Period;
      out = read.value_or(out);
    } else {
      const std::size_t mistakes = diagnostics_.size();
      take(part, Field::Period, out);
      if (diagnostics_.size() == mistakes) return;
      if (const Result<Duration> meant = parse_rate(period->text)) {
        diagnostics_.back().hint =
            fmt::format("write 'rate: {}', or 'period: {}'", period->text, format_duration(*meant));
      }
    }
  }

  /// True if predecessors release the task's jobs, because it has some and states nothing that only timers have. Most
  /// people who write `after: x` mean that `x` releases the task. The period of the DAG is a default of its timer tasks
  /// and does not say which these are. Descriptions of recorded runs keep the former rule (`timers_by_default`).
  bool is_data_by_default(const Task &task, const TaskPart &part) const {
    if (options_.timers_by_default) return false;
    const Node *after = find(part, Field::After);
    const bool has_predecessor = after != nullptr && after->kind != Node::Kind::Null &&
                                 (after->kind != Node::Kind::Sequence || !after->children.empty());
    const bool may_have_timer =
        part.broken.intersects(Field::Callback) || (task.callback && task.callback->kind == Callback::Kind::Timer);
    return has_predecessor && find(part, Field::Activation) == nullptr && own_period(part) == nullptr &&
           !may_have_timer;
  }

  void take_period(Task &task, TaskPart &part, Duration inherited, FieldSet dag_broken) {
    if (is_data_by_default(task, part)) task.activation = Activation::Data;
    const Node *given = own_period(part);
    if (part.broken.intersects(Field::Activation)) part.broken |= Field::Period;
    if (task.activation == Activation::Data) {
      if (given == nullptr) return;
      const char *key = given == find(part, Field::Period) ? "period" : "rate";
      error(*given, fmt::format("data task '{}' has a {}", task.name, key),
            fmt::format("a data task inherits its period: remove '{}:', or use 'activation: timer'", key));
      part.broken |= Field::Period;
    } else if (given != nullptr) {
      take_own_period(part, task.period, fmt::format("task '{}'", task.name));
    } else if (part.broken.intersects(Field::Callback)) {
      part.broken |= Field::Period;  // its timer may have one
    } else if (task.callback && task.callback->period != 0) {
      task.period = task.callback->period;
    } else {
      task.period = inherited;
      if (dag_broken.intersects(Field::Period)) part.broken |= Field::Period;
    }
  }

  void take_overrun(Task &task, TaskPart &part) {
    const Node *node = find(part, Field::Overrun);
    if (node == nullptr || node->is("skip")) return;
    task.overrun = Overrun::Queue;
    if (node->is("queue")) return;
    const std::size_t mistakes = diagnostics_.size();
    if (node->kind != Node::Kind::Map) {
      unknown_choice(*node, "overrun", {"skip", "queue", "{queue: N}"});
    } else {
      check_map(*node, "overrun", {"queue"});
      if (yaml::find(*node, "queue") == nullptr) error(*node, "overrun 'queue' needs a depth", "write {queue: 3}");
      ValueReader::take(*node, "queue", task.queue_depth, 1, kMaxQueueDepth);
    }
    if (diagnostics_.size() > mistakes) part.broken |= Field::Overrun;
  }

  /// Turns names into indices, once all tasks of the DAG are known.
  void read_edges(Dag &dag, DagPart &part) {
    std::unordered_map<std::string_view, std::uint32_t> positions;
    std::vector<std::string_view> names;
    positions.reserve(dag.tasks.size());
    for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
      names.emplace_back(dag.tasks[i].name);
      positions.emplace(dag.tasks[i].name, i);
    }
    for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
      TaskPart &task = part.tasks[i];
      const Node *after = find(task, Field::After);
      if (after == nullptr) continue;
      const bool list = after->kind == Node::Kind::Sequence;
      for (const Node &item : list ? std::span<const Node>(after->children) : std::span<const Node>(after, 1)) {
        read_edge(item, dag, i, task, positions, names);
      }
    }
  }

  void read_edge(const Node &item, Dag &dag, std::uint32_t index, TaskPart &part,
                 const std::unordered_map<std::string_view, std::uint32_t> &positions,
                 const std::vector<std::string_view> &names) {
    if (const auto name = text(item, "after")) {
      const auto found = positions.find(*name);
      if (found != positions.end()) {
        dag.tasks[index].predecessors.push_back(found->second);
        part.edges.push_back(&item);
        return;
      }
      const std::string prefix = dag.name + ".";
      const bool has_dag = name->starts_with(prefix) && positions.count(name->substr(prefix.size())) != 0;
      error(item, fmt::format("there is no task {} in DAG '{}'", yaml::describe(item), dag.name),
            has_dag ? fmt::format("write '{}', without the name of the DAG", name->substr(prefix.size()))
                    : did_you_mean(*name, names, "'after' can only name tasks of the same DAG"));
    }
    part.broken |= Field::After;
  }

  // --- the workload as a whole ---

  /// Sets periods of data tasks, and deadlines that are not given. A DAG with wrong edges has no periods to inherit.
  void inherit() {
    std::vector<bool> unsound(workload_.dags.size(), false);
    for (const Finding &finding : find_mistakes(workload_, options_)) {
      const bool structural = finding.field == Field::After || finding.field == Field::Activation;
      if (finding.dag.valid() && structural) unsound[finding.dag.value] = true;
    }
    for (std::size_t d = 0; d < workload_.dags.size(); ++d) {
      Dag &dag = workload_.dags[d];
      for (Task &task : dag.tasks) task.group = joined(std::move(task.group));
      std::vector<std::uint32_t> order(dag.tasks.size());
      if (!unsound[d]) {
        const std::vector<std::uint32_t> ranks = topological_ranks(dag);
        for (std::uint32_t i = 0; i < ranks.size(); ++i) order[ranks[i]] = i;
        mark_unknown_periods(dag, dags_[d], order);
        inherit_periods(dag);
        continue;
      }
      for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
        Task &task = dag.tasks[i];
        if (task.activation == Activation::Data) dags_[d].tasks[i].broken |= Field::Period;
        mark_unknown_deadline(task, dags_[d].tasks[i]);
        if (task.deadline == 0) task.deadline = task.period;
      }
    }
  }

  static void mark_unknown_periods(const Dag &dag, DagPart &part, const std::vector<std::uint32_t> &order) {
    for (const std::uint32_t i : order) {
      const Task &task = dag.tasks[i];
      const auto unknown = [&](std::uint32_t p) { return part.tasks[p].broken.intersects(Field::Period); };
      if (task.activation == Activation::Data &&
          (part.tasks[i].broken.intersects(Field::After) ||
           std::any_of(task.predecessors.begin(), task.predecessors.end(), unknown))) {
        part.tasks[i].broken |= Field::Period;
      }
      mark_unknown_deadline(task, part.tasks[i]);
    }
  }

  static void mark_unknown_deadline(const Task &task, TaskPart &part) {
    if (task.deadline == 0 && part.broken.intersects(Field::Period)) part.broken |= Field::Deadline;
  }

  void report(std::vector<Finding> findings) {
    FieldSet broken = root_.broken;
    for (const DagPart &dag : dags_) {
      broken |= dag.broken;
      for (const TaskPart &task : dag.tasks) broken |= task.broken;
    }
    for (Finding &finding : findings) {
      const Part *part = &root_;
      FieldSet unknown = broken;  // a finding about the whole workload depends on all of it
      if (finding.dag.valid()) {
        const DagPart &dag = dags_[finding.dag.value];
        part = finding.task == Finding::kNone ? static_cast<const Part *>(&dag) : &dag.tasks[finding.task];
        unknown = part->broken;
        if (finding.field == Field::Priority || finding.involves.intersects(Field::Clusters | Field::Devices)) {
          unknown |= root_.broken;
        }
      }
      if (finding.involves.intersects(unknown)) continue;
      const Node &at = place(finding, *part);
      diagnostics_.push_back(
          Diagnostic{finding.severity, file_, at.line, at.column, std::move(finding.message), std::move(finding.hint)});
    }
  }

  const Node &place(const Finding &finding, const Part &part) const {
    const bool of_platform = fields::all_of(fields::kPlatform).intersects(finding.field);
    const Part &holder = of_platform && platform_.node != nullptr ? platform_ : part;
    const Node *value = finding.field == Field::Period ? own_period(holder) : find(holder, finding.field);
    if (value == nullptr) return *part.node;
    if (finding.item == Finding::kNone) return *value;
    if (finding.field == Field::Clusters) return value->children[finding.item];
    // A map of keys and values; waits stand between cpu segments.
    if (finding.field == Field::Devices) return value->children[std::size_t{2} * finding.item];
    if (finding.field == Field::Segments) return value->children[std::size_t{2} * finding.item + 1];
    if (finding.field == Field::After) return *dags_[finding.dag.value].tasks[finding.task].edges[finding.item];
    if (finding.field == Field::Callback) {
      const Callback &callback = *workload_.dags[finding.dag.value].tasks[finding.task].callback;
      return *yaml::find(*value, finding.item == kCallbackNode ? "node" : to_string(callback.kind));
    }
    const Node *samples = yaml::find(*value, "empirical");
    return samples == nullptr ? *value : samples->children[finding.item];
  }

  LoadOptions options_;
  Part root_;
  Part platform_;
  std::vector<DagPart> dags_;
  std::unordered_map<std::string, std::string> groups_;  // that lists name after another one, and that one
  Workload workload_;
  bool structure_known_ = false;
};

}  // namespace

Result<LoadedWorkload> parse_workload(std::string_view text, std::string file_name, LoadOptions options) {
  if (text.size() > kMaxWorkloadBytes) {
    return file_error(file_name, 0, fmt::format("the file is larger than {} MiB", kMaxWorkloadBytes >> 20U));
  }
  const Result<Node> root = yaml::parse(text, file_name);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return read_workload(*root, std::move(file_name), options);
}

Result<LoadedWorkload> read_workload(const Node &root, std::string file_name, LoadOptions options) {
  return Reader(root, std::move(file_name), options).run();
}

Result<LoadedWorkload> load_workload(const std::filesystem::path &path, LoadOptions options) {
  const Result<std::string> text = read_file(path.string(), kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  Result<LoadedWorkload> loaded = parse_workload(*text, path.string(), options);
  if (loaded) name_after(path, loaded->workload);
  return loaded;
}

void name_after(const std::filesystem::path &path, Workload &workload) {
  if (workload.name.empty() && name_mistake(path.stem().string()).empty()) workload.name = path.stem().string();
}

}  // namespace redag
