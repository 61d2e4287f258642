// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/kernel_record.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>

#include "redag/base/lines.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::metrics {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kKernelFormat = "redag.kernel/1";

bool is_time(const Json &value) {
  if (!value.is_number_integer()) return false;
  const auto time = value.get<std::int64_t>();
  return time >= -trace::kMaxTraceTime && time <= trace::kMaxTraceTime;
}

bool are_integers(const Json &row, std::initializer_list<std::size_t> places) {
  return std::all_of(places.begin(), places.end(), [&](std::size_t i) { return row[i].is_number_integer(); });
}

// Reads a line such as ["switch",time,cpu,from,runnable,to,priority]. Returns false if it is none.
bool read_row(const Json &row, KernelRecord &record) {
  if (!row.is_array() || row.empty() || !row[0].is_string()) return false;
  const auto kind = row[0].get<std::string>();
  if (kind == "switch") {
    if (row.size() != 7 || !is_time(row[1]) || !are_integers(row, {2, 3, 5, 6}) || !row[4].is_boolean()) return false;
    if (!record.switches.empty() && row[1].get<Time>() < record.switches.back().time) return false;
    record.switches.push_back({row[1], row[2], row[3], row[4], row[5], row[6]});
    return true;
  }
  if (kind == "interrupt") {
    if (row.size() != 5 || !is_time(row[1]) || !is_time(row[2]) || !are_integers(row, {3}) || !row[4].is_string())
      return false;
    if (row[2].get<Time>() < row[1].get<Time>()) return false;
    if (!record.interrupts.empty() && row[2].get<Time>() < record.interrupts.back().end) return false;
    record.interrupts.push_back({row[1], row[2], row[3], row[4]});
    return true;
  }
  if (kind == "job") {
    if (row.size() != 4 || !row[1].is_number_unsigned() || !row[2].is_number_unsigned() || !are_integers(row, {3}))
      return false;
    record.jobs.push_back({TaskId(row[1].get<std::uint32_t>()), row[2], row[3]});
    return true;
  }
  if (kind != "thread" || row.size() != 4 || !are_integers(row, {1}) || !row[2].is_string() || !row[3].is_boolean())
    return false;
  record.names[row[1]] = row[2];
  if (row[3].get<bool>()) record.own.insert(row[1].get<int>());
  return true;
}

}  // namespace

Result<std::optional<KernelRecord>> read_kernel_record_of(const std::string &trace, const trace::RunInfo &run) {
  const std::string path = (std::filesystem::path(trace).parent_path() / "kernel.jsonl").string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::optional<KernelRecord>();
  Result<KernelRecord> record = read_kernel_record(path);
  if (!record) return tl::unexpected<Diagnostics>(std::move(record.error()));
  if (!(record->run == run.provenance)) return std::optional<KernelRecord>();
  return std::optional<KernelRecord>(*std::move(record));
}

Result<void> write_kernel_record(const std::string &path, const KernelRecord &record) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  const auto quoted = [](const std::string &text) {
    return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
  };
  file->write(fmt::format("{{\"format\":\"{}\",\"lost\":{},\"provenance\":{}}}\n", kKernelFormat, record.lost,
                          provenance_to_json(record.run)));
  for (const auto &[thread, name] : record.names) {
    file->write(fmt::format("[\"thread\",{},{},{}]\n", thread, quoted(name), record.own.contains(thread)));
  }
  for (const JobThread &job : record.jobs) {
    file->write(fmt::format("[\"job\",{},{},{}]\n", job.task.value, job.number, job.thread));
  }
  for (const KernelSwitch &one : record.switches) {
    file->write(fmt::format("[\"switch\",{},{},{},{},{},{}]\n", one.time, one.cpu, one.from, one.runnable, one.to,
                            one.to_priority));
  }
  for (const KernelInterrupt &one : record.interrupts) {
    file->write(fmt::format("[\"interrupt\",{},{},{},{}]\n", one.begin, one.end, one.cpu, quoted(one.name)));
  }
  file->write("{\"end\":true}\n");
  return file->commit();
}

Result<KernelRecord> read_kernel_record(const std::string &path) {
  const Result<std::string> text = trace::read_file(path);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_kernel_record(*text, path);
}

Result<KernelRecord> parse_kernel_record(std::string_view text, const std::string &file) {
  KernelRecord record;
  bool complete = false;
  int number = 0;
  while (!text.empty()) {
    const std::string_view line = next_line(text);
    ++number;
    if (complete) return trace::file_error(file, number, "there is text after the last line");
    const Json json = json_nests_deeper(line) ? Json() : Json::parse(line, nullptr, false);
    if (number == 1) {
      if (!json.is_object() || json.value("format", Json()) != kKernelFormat ||
          !json.value("lost", Json()).is_number_unsigned())
        return trace::file_error(file, 1, "this is not a kernel's record of a run", "'redag run --kernel' writes one");
      record.lost = json["lost"];
      Result<Provenance> run = provenance_from_json(json.value("provenance", Json::object()).dump());
      if (!run) return trace::file_error(file, 1, "the provenance is not an object of texts");
      record.run = *std::move(run);
    } else if (json.is_object() && json.contains("end")) {
      complete = true;
    } else if (!read_row(json, record)) {
      return trace::file_error(file, number, "this line is no event of the kernel, or not in order of time");
    }
  }
  if (!complete) return trace::file_error(file, number, "the file is incomplete: its last line is missing");
  return record;
}

}  // namespace redag::metrics
