// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/events_file.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/model/validate.hpp"
#include "redag/trace/run_info_json.hpp"

namespace redag::trace {
namespace {

constexpr std::string_view kFormat = "redag.events/1";

// Reads one event: [time,"kind",task,job,worker,value,"reason"]; worker -1: none. It is JSON, but a JSON parser would
// be slow for millions of lines.
class LineReader {
 public:
  explicit LineReader(std::string_view line) : rest_(line) {}

  bool skip(char c) {
    if (rest_.empty() || rest_.front() != c) return false;
    rest_.remove_prefix(1);
    return true;
  }

  template <class Integer>
  bool read(Integer &value) {
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc{}) return false;
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return true;
  }

  template <class Enum>
  bool read_name(Enum &value, Enum last) {
    if (!skip('"')) return false;
    const std::size_t length = rest_.find('"');
    if (length == std::string_view::npos) return false;
    const std::string_view name = rest_.substr(0, length);
    rest_.remove_prefix(length + 1);
    for (auto i = 0U; i <= static_cast<unsigned>(last); ++i) {
      value = static_cast<Enum>(i);
      if (name == to_string(value)) return true;
    }
    return false;
  }

  [[nodiscard]] bool at_end() const { return rest_.empty(); }

 private:
  std::string_view rest_;
};

bool read_event(std::string_view line, JobEvent &event) {
  LineReader in(line);
  std::int64_t worker = -1;
  const bool well_formed = in.skip('[') && in.read(event.time) && in.skip(',') &&
                           in.read_name(event.kind, kLastJobEventKind) && in.skip(',') && in.read(event.task.value) &&
                           in.skip(',') && in.read(event.job) && in.skip(',') && in.read(worker) && in.skip(',') &&
                           in.read(event.value) && in.skip(',') && in.read_name(event.reason, kLastReason) &&
                           in.skip(']') && in.at_end();
  if (!well_formed || worker < -1 || worker >= kMaxWorkers) return false;
  event.worker = worker < 0 ? WorkerId::kNoneValue : static_cast<std::uint32_t>(worker);
  return true;
}

bool is_a_time(std::int64_t time) { return time >= -kMaxTraceTime && time <= kMaxTraceTime; }

struct Footer {
  std::uint64_t events = 0;
  Time end = 0;
  std::uint64_t lost_events = 0;
};

std::optional<Footer> read_footer(std::string_view line) {
  if (json_nests_deeper(line)) return std::nullopt;
  const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  const auto events = json.find("events");
  const auto end = json.find("end_ns");
  const auto lost = json.find("lost_events");
  if (events == json.end() || !events->is_number_unsigned() || end == json.end() || !end->is_number_integer() ||
      lost == json.end() || !lost->is_number_unsigned() || !is_a_time(end->get<std::int64_t>())) {
    return std::nullopt;
  }
  return Footer{events->get<std::uint64_t>(), end->get<std::int64_t>(), lost->get<std::uint64_t>()};
}

}  // namespace

Result<EventsWriter> EventsWriter::create(const std::string &path, const RunInfo &info) {
  Diagnostics mistakes = validate(info.workload, {.wcet_optional = true});
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  Result<OutputFile> file = OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  file->write(run_header_to_json(kFormat, info) + "\n");
  return EventsWriter(std::move(*file));
}

void EventsWriter::add(std::span<const JobEvent> events) {
  fmt::memory_buffer line;
  for (const JobEvent &event : events) {
    line.clear();
    const std::int64_t worker = event.worker == WorkerId::kNoneValue ? -1 : std::int64_t{event.worker};
    fmt::format_to(std::back_inserter(line), FMT_COMPILE("[{},\"{}\",{},{},{},{},\"{}\"]\n"), event.time,
                   to_string(event.kind), event.task.value, event.job, worker, event.value, to_string(event.reason));
    file_.write({line.data(), line.size()});
  }
  count_ += events.size();
}

Result<void> EventsWriter::commit(Time end, std::uint64_t lost_events) {
  file_.write(fmt::format("{{\"events\":{},\"end_ns\":{},\"lost_events\":{}}}\n", count_, end, lost_events));
  return file_.commit();
}

Result<void> write_trace(const std::string &path, const Trace &trace) {
  Result<EventsWriter> writer = EventsWriter::create(path, trace.info);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  writer->add(trace.events);
  return writer->commit(trace.info.end, trace.info.lost_events);
}

Result<Trace> read_trace(const std::string &path) {
  const Result<std::string> text = read_file(path);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_trace(*text, path);
}

Result<Trace> parse_trace(std::string_view text, const std::string &file) {
  Trace trace;
  std::size_t task_count = 0;
  std::optional<Footer> footer;
  int number = 0;
  while (!text.empty()) {
    const std::size_t length = text.find('\n');
    const std::string_view line = text.substr(0, length);
    text.remove_prefix(length == std::string_view::npos ? text.size() : length + 1);
    ++number;
    if (number == 1) {
      Result<RunInfo> info = run_header_from_json(line, kFormat, "an event trace", file);
      if (!info) return tl::unexpected<Diagnostics>(std::move(info.error()));
      trace.info = std::move(*info);
      task_count = trace.info.workload.task_count();
      trace.events.reserve(text.size() / 48);  // length of a typical line
      continue;
    }
    if (footer) return file_error(file, number, "there is text after the last line");
    JobEvent event;
    if (!line.empty() && line.front() == '{') {
      footer = read_footer(line);
      if (!footer) return file_error(file, number, "the last line must have events, end_ns and lost_events");
    } else if (!read_event(line, event) || !has_valid_times(event)) {
      return file_error(file, number, "this line is not an event",
                        "an event is written as [time,\"kind\",task,job,worker,value,\"reason\"]");
    } else if (event.task.value >= task_count) {
      return file_error(file, number, "task " + std::to_string(event.task.value) + " is not in the workload");
    } else {
      trace.events.push_back(event);
    }
  }
  if (number == 0) return file_error(file, 0, "the file is empty");
  if (!footer) return file_error(file, number, "the file is incomplete: its last line is missing");
  if (footer->events != trace.events.size()) {
    return file_error(file, number,
                      "the file has " + std::to_string(trace.events.size()) + " events, but " +
                          std::to_string(footer->events) + " were written");
  }
  if (footer->end < trace.info.start) return file_error(file, number, "the run ends before it begins");
  trace.info.end = footer->end;
  trace.info.lost_events = footer->lost_events;
  return trace;
}

}  // namespace redag::trace
