// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_json.hpp"

#include <algorithm>

#include "redag/live/rates.hpp"

namespace redag::cli {
namespace {

Json or_null(Duration value) { return value > 0 ? Json(value) : Json(nullptr); }

Json figures_json(const live::page::Figures &f, const live::Frame &frame) {
  return {{"rate", rate_of(f, frame)},
          {"cpu", cpu_of(f, frame)},
          {"released", f.released},
          {"finished", f.finished},
          {"skipped", f.skipped},
          {"aborted", f.aborted},
          {"misses", f.misses},
          {"deferred", f.deferred},
          {"preemptions", f.preemptions},
          {"cpu_ns", f.cpu},
          {"response", {{"p50_ns", f.response_p50}, {"p99_ns", f.response_p99}, {"max_ns", f.response_max}}},
          {"recent",
           {{"finished", f.recent_jobs},
            {"misses", f.recent_misses},
            {"preemptions", f.recent_preemptions},
            {"cpu_ns", f.recent_cpu},
            {"response", {{"p50_ns", f.recent_p50}, {"p99_ns", f.recent_p99}, {"max_ns", f.recent_max}}}}},
          {"active", f.active},
          {"away", f.away},
          {"ready", f.ready},
          {"waiting", f.waiting}};
}

Json device_json(const live::DeviceFrame &device, const live::Frame &frame) {
  Json tasks = Json::array();
  for (const std::uint32_t task : device.tasks) tasks.push_back(full_name(frame.tasks[task], frame));
  return {{"name", device.name},
          {"slots", device.slots},
          {"used", device.used},
          {"queued", device.queued},
          {"tasks", std::move(tasks)},
          {"busy", share_of(device, frame)},
          {"rate", rate_of(device, frame)},
          {"served", device.served},
          {"busy_ns", device.busy},
          {"recent", {{"served", device.recent_served}, {"busy_ns", device.recent_busy}}}};
}

Json task_json(const live::TaskFrame &task, const live::Frame &frame) {
  Json row = {{"dag", frame.dags[task.dag].name},  {"name", task.name},
              {"period_ns", or_null(task.period)}, {"deadline_ns", or_null(task.deadline)},
              {"bound_ns", or_null(task.bound)},   {"priority", or_null(task.priority)}};
  row.update(figures_json(task.figures, frame));
  return row;
}

}  // namespace

Json to_json(const live::Listed &listed, const live::Page &page, Time now) {
  const live::Frame &frame = page.frame;
  const std::string hint = hint_on_misses(frame);
  Json document = {{"format", "redag.live/1"},
                   {"pid", listed.pid},
                   {"number", listed.number},
                   {"path", listed.path},
                   {"name", frame.name},
                   {"program", frame.program},
                   {"driver", frame.driver},
                   {"workers", frame.workers},
                   {"preemption", frame.preemption},
                   {"policy", frame.policy},
                   {"sequence", frame.sequence},
                   {"age_ns", std::max<Duration>(0, now - frame.published)},
                   {"up_ns", frame.published - frame.began},
                   {"interval_ns", frame.interval},
                   {"window_ns", frame.window},
                   {"page_cpu_ns", frame.publisher_cpu},
                   {"left_out", frame.left_out},
                   {"threads", Json::array()},
                   {"threads_in_all", frame.threads_in_all},
                   {"devices", Json::array()},
                   {"devices_in_all", frame.devices_in_all},
                   {"on_misses", hint.empty() ? Json(nullptr) : Json(hint)},
                   {"alert", frame.alert.empty() ? Json(nullptr) : Json(frame.alert)},
                   {"dags", Json::array()},
                   {"tasks", Json::array()}};
  for (const live::ThreadFrame &thread : frame.threads) {
    document["threads"].push_back(
        {{"index", thread.index},
         {"cpu", share_of(thread, frame)},
         {"cpu_ns", thread.used},
         {"task", thread.task ? Json(full_name(frame.tasks[*thread.task], frame)) : Json(nullptr)}});
  }
  for (const live::DeviceFrame &device : frame.devices) document["devices"].push_back(device_json(device, frame));
  for (const live::DagFrame &dag : frame.dags) {
    Json row = {{"name", dag.name},
                {"max_active", dag.max_active},
                {"deadline_ns", or_null(dag.deadline)},
                {"late", dag.late},
                {"recent_late", dag.recent_late}};
    row.update(figures_json(dag.figures, frame));
    document["dags"].push_back(std::move(row));
  }
  for (const live::TaskFrame &task : frame.tasks) document["tasks"].push_back(task_json(task, frame));
  return document;
}

Json to_json(const std::vector<live::Listed> &pages, Time now) {
  Json list = Json::array();
  for (const live::Listed &listed : pages) {
    Json row = {{"pid", listed.pid}, {"number", listed.number}, {"path", listed.path}};
    if (listed.page) {
      const live::Frame &frame = listed.page->frame;
      row.update(Json{{"name", frame.name},
                      {"program", frame.program},
                      {"driver", frame.driver},
                      {"tasks", frame.tasks.size()},
                      {"up_ns", frame.published - frame.began},
                      {"age_ns", std::max<Duration>(0, now - frame.published)}});
    } else {
      row["diagnostics"] = diagnostics_json(listed.page.error());
    }
    list.push_back(std::move(row));
  }
  return {{"format", "redag.live-list/1"}, {"executors", std::move(list)}};
}

Json machine_json(const std::vector<live::Listed> &pages, const LiveView &view) {
  Json tasks = Json::array();
  for (const LiveRow &row : rows_of(pages, view)) {
    Json task = {{"pid", row.executor->pid}, {"number", row.executor->number}, {"executor", row.frame().name}};
    task.update(task_json(*row.task, row.frame()));
    tasks.push_back(std::move(task));
  }
  return {{"format", "redag.live-all/1"}, {"tasks", std::move(tasks)}};
}

}  // namespace redag::cli
