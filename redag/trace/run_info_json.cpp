// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/run_info_json.hpp"

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"

namespace redag::trace {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kPreemptions = {sched::Preemption::None, sched::Preemption::Cooperative, sched::Preemption::Full};
constexpr std::array kDrivers = {Driver::Simulator, Driver::Threads, Driver::Ros, Driver::RosNodes};

// Thrown only inside this file. run_info_from_json() turns it into a Diagnostic.
struct BadValue : std::runtime_error {
  using std::runtime_error::runtime_error;
};

const Json &member(const Json &object, const char *key) {
  const auto found = object.find(key);
  if (found == object.end()) throw BadValue(std::string("key '") + key + "' is missing");
  return *found;
}

std::string text_of(const Json &object, const char *key) {
  const Json &value = member(object, key);
  if (!value.is_string()) throw BadValue(std::string("'") + key + "' must be a string");
  return value.get<std::string>();
}

std::int64_t integer_of(const Json &object, const char *key, std::int64_t low, std::int64_t high) {
  const Json &value = member(object, key);
  const bool fits = value.is_number_integer() &&
                    (!value.is_number_unsigned() ||
                     value.get<std::uint64_t>() <= std::uint64_t{std::numeric_limits<std::int64_t>::max()});
  if (!fits || value.get<std::int64_t>() < low || value.get<std::int64_t>() > high) {
    throw BadValue(std::string("'") + key + "' must be a whole number from " + std::to_string(low) + " to " +
                   std::to_string(high));
  }
  return value.get<std::int64_t>();
}

std::uint32_t small_of(const Json &object, const char *key, std::uint32_t low, std::uint32_t high) {
  return static_cast<std::uint32_t>(integer_of(object, key, low, high));
}

std::uint64_t unsigned_of(const Json &object, const char *key) {
  const Json &value = member(object, key);
  if (!value.is_number_unsigned()) throw BadValue(std::string("'") + key + "' must be a whole number of at least 0");
  return value.get<std::uint64_t>();
}

template <class Values, class Name>
auto one_of(const Values &values, Name name, const Json &object, const char *key) {
  const std::string text = text_of(object, key);
  for (const auto value : values) {
    if (text == name(value)) return value;
  }
  throw BadValue(std::string("'") + key + "' has the unknown value '" + text + "'");
}

template <class Enum>
Enum one_of(const Json &object, const char *key) {
  return one_of(
             kValues<Enum>, [](const Named<Enum> &named) { return named.name; }, object, key)
      .value;
}

sched::Config config_from(const Json &json) {
  constexpr std::uint32_t kAny = std::numeric_limits<std::uint32_t>::max();
  sched::Config config;
  config.workers = small_of(json, "workers", 1, kMaxWorkers);
  const bool is_old = text_of(json, "preemption") == "full";
  config.preemption = is_old ? sched::Preemption::Full : one_of(kPreemptions, preemption_name, json, "preemption");
  config.policy = one_of<PolicyKind>(json, "policy");
  // Files from before ties were shared do not state them; their order was fixed.
  config.ties = Ties::Fixed;
  if (json.contains("ties")) config.ties = one_of<Ties>(json, "ties");
  config.levels = small_of(json, "levels", 0, kAny);
  config.max_started = small_of(json, "max_started", 0, kAny);
  return config;
}

Machine machine_from(const Json &json) {
  Machine machine;
  machine.cpus = small_of(json, "cpus", 0, std::numeric_limits<std::uint32_t>::max());
  machine.kernel = text_of(json, "kernel");
  machine.model = text_of(json, "model");
  return machine;
}

// Returns the rows of a list that files of earlier versions do not have, and that is left out if it would be empty.
Json rows_of(const Json &object, const char *key) {
  Json rows = object.value(key, Json::array());
  if (!rows.is_array()) throw BadValue(std::string("'") + key + "' must be a list");
  return rows;
}

std::vector<Remark> remarks_from(const Json &json) {
  std::vector<Remark> remarks;
  for (const Json &row : rows_of(json, "remarks")) {
    Remark remark;
    remark.begun = integer_of(row, "begun_ns", -kMaxTraceTime, kMaxTraceTime);
    if (!member(row, "ended_ns").is_null()) remark.ended = integer_of(row, "ended_ns", -kMaxTraceTime, kMaxTraceTime);
    remark.text = text_of(row, "text");
    remarks.push_back(std::move(remark));
  }
  return remarks;
}

// Present only in runs of an Executor with such tasks.
std::vector<TaskId> event_tasks_from(const Json &json, std::size_t task_count) {
  std::vector<TaskId> tasks;
  for (const Json &row : rows_of(json, "event_tasks")) {
    if (!row.is_number_unsigned() || row.get<std::uint64_t>() >= task_count) {
      throw BadValue("'event_tasks' must list positions of tasks in the workload");
    }
    tasks.emplace_back(row.get<std::size_t>());
  }
  return tasks;
}

std::vector<Removal> removals_from(const Json &json, std::size_t task_count) {
  std::vector<Removal> removals;
  for (const Json &row : rows_of(json, "removals")) {
    const std::uint64_t task = unsigned_of(row, "task");
    if (task >= task_count) throw BadValue("'removals' must name positions of tasks in the workload");
    removals.push_back({TaskId(task), integer_of(row, "at_ns", -kMaxTraceTime, kMaxTraceTime)});
  }
  return removals;
}

std::vector<Edge> edges_from(const Json &json, std::size_t task_count) {
  std::vector<Edge> edges;
  const auto task_of = [&](const Json &row, const char *key) {
    const std::int64_t task = integer_of(row, key, 0, std::numeric_limits<std::uint32_t>::max());
    if (static_cast<std::size_t>(task) >= task_count)
      throw BadValue("'edges' must name positions of tasks in the workload");
    return TaskId(static_cast<std::size_t>(task));
  };
  for (const Json &row : rows_of(json, "edges")) {
    Edge edge{.from = task_of(row, "from"), .to = task_of(row, "to")};
    edge.since = integer_of(row, "since_ns", -kMaxTraceTime, kMaxTraceTime);
    if (row.contains("until_ns")) edge.until = integer_of(row, "until_ns", -kMaxTraceTime, kMaxTraceTime);
    edges.push_back(edge);
  }
  return edges;
}

// Files of earlier versions state events by `event_tasks` alone, as timers.
void mark_events(RunInfo &info) {
  std::vector<Task *> tasks;
  for (Dag &dag : info.workload.dags) {
    for (Task &task : dag.tasks) tasks.push_back(&task);
  }
  for (const TaskId id : info.event_tasks) {
    Task &task = *tasks[id.value];
    if (task.activation != Activation::Timer) continue;
    task.phase = Phase::Event;
    task.offset = 0;
  }
}

RunInfo info_from(const Json &json) {
  RunInfo info;
  info.executor = text_of(json, "executor");
  info.config = config_from(member(json, "config"));
  info.preemption = text_of(json, "preemption");
  info.preemption_why = text_of(json, "preemption_why");
  info.driver = one_of(
      kDrivers, [](Driver d) { return to_string(d); }, json, "driver");
  info.seed = unsigned_of(json, "seed");
  info.start = integer_of(json, "start_ns", -kMaxTraceTime, kMaxTraceTime);
  info.end = integer_of(json, "end_ns", -kMaxTraceTime, kMaxTraceTime);
  info.warm_up = integer_of(json, "warm_up_ns", 0, kMaxTraceTime);
  info.stepped = json.value("stepped", false);
  info.lost_events = unsigned_of(json, "lost_events");
  info.overheads = text_of(json, "overheads");
  info.machine = machine_from(member(json, "machine"));
  info.remarks = remarks_from(json);
  if (json.contains("origin_ns")) info.origin = integer_of(json, "origin_ns", 0, kMaxTraceTime);
  if (json.contains("settled_ns")) info.settled = integer_of(json, "settled_ns", -kMaxTraceTime, kMaxTraceTime);
  return info;
}

}  // namespace

std::string run_info_to_json(const RunInfo &info) {
  const sched::Config &config = info.config;
  Json json = {
      {"executor", info.executor},
      {"config",
       {{"workers", config.workers},
        {"preemption", preemption_name(config.preemption)},
        {"policy", to_string(config.policy)},
        {"ties", to_string(config.ties)},
        {"levels", config.levels},
        {"max_started", config.max_started}}},
      {"preemption", info.preemption},
      {"preemption_why", info.preemption_why},
      {"driver", to_string(info.driver)},
      {"seed", info.seed},
      {"start_ns", info.start},
      {"end_ns", info.end},
      {"warm_up_ns", info.warm_up},
      {"lost_events", info.lost_events},
      {"overheads", info.overheads},
      {"machine", {{"cpus", info.machine.cpus}, {"kernel", info.machine.kernel}, {"model", info.machine.model}}},
      {"workload", to_yaml(info.workload)}};
  if (info.stepped) json["stepped"] = true;
  for (const Remark &remark : info.remarks) {
    json["remarks"].push_back({{"begun_ns", remark.begun},
                               {"ended_ns", remark.ended == kNever ? Json() : Json(remark.ended)},
                               {"text", remark.text}});
  }
  for (const TaskId task : info.event_tasks) json["event_tasks"].push_back(task.value);
  for (const Removal &removal : info.removals) {
    json["removals"].push_back({{"task", removal.task.value}, {"at_ns", removal.at}});
  }
  for (const Edge &edge : info.edges) {
    json["edges"].push_back({{"from", edge.from.value}, {"to", edge.to.value}, {"since_ns", edge.since}});
    if (edge.until != kNever) json["edges"].back()["until_ns"] = edge.until;
  }
  if (info.origin) json["origin_ns"] = *info.origin;
  if (info.settled) json["settled_ns"] = *info.settled;
  // Texts from outside may not be UTF-8; a replaced character is better than no file.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Result<RunInfo> run_info_from_json(std::string_view text, const std::string &file, int line) {
  if (json_is_too_large(text))
    return file_error(file, line, "the description of the run is nested too deeply, or has too many values");
  try {
    const Json json = Json::parse(text);
    if (!json.is_object()) return file_error(file, line, "the description of the run must be an object");
    RunInfo info = info_from(json);
    // Files of earlier versions do not state the activation of timer tasks; this one does wherever it matters.
    Result<LoadedWorkload> loaded = parse_workload(text_of(json, "workload"), file + " (workload)",
                                                   {.wcet_optional = true, .waits = true, .timers_by_default = true});
    if (!loaded) return tl::unexpected<Diagnostics>(std::move(loaded.error()));
    info.workload = std::move(loaded->workload);
    info.event_tasks = event_tasks_from(json, info.workload.task_count());
    info.removals = removals_from(json, info.workload.task_count());
    info.edges = edges_from(json, info.workload.task_count());
    mark_events(info);
    return info;
  } catch (const BadValue &error) {
    return file_error(file, line, error.what());
  } catch (const nlohmann::json::exception &error) {
    return file_error(file, line, error.what());
  }
}

std::string run_header_to_json(std::string_view format, const RunInfo &info) {
  std::string text = R"({"format":")" + std::string(format) + R"(",)";
  if (info.provenance.is_known()) text += "\"provenance\":" + provenance_to_json(info.provenance) + ",";
  return text + "\"run\":" + run_info_to_json(info) + "}";
}

Result<RunInfo> run_header_from_json(std::string_view text, std::string_view format, const char *what,
                                     const std::string &file) {
  const std::string wrong = std::string("not ") + what + ": ";
  if (json_is_too_large(text)) return file_error(file, 1, wrong + "nested too deeply, or too many values");
  const Json json = Json::parse(text, nullptr, false);
  const auto given = json.is_object() ? json.find("format") : json.end();
  if (!json.is_object() || given == json.end() || *given != format || !json.contains("run")) {
    return file_error(file, 1, wrong + R"(the first line must have "format": ")" + std::string(format) + R"(")",
                      "'redag run' and 'redag simulate' write such files with --out");
  }
  Result<RunInfo> info = run_info_from_json(json["run"].dump(), file, 1);
  if (!info || !json.contains("provenance")) return info;
  Result<Provenance> provenance = provenance_from_json(json["provenance"].dump());
  if (!provenance) return file_error(file, 1, provenance.error().front().message);
  info->provenance = *std::move(provenance);
  return info;
}

}  // namespace redag::trace
