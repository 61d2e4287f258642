// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// redag.events/1: a line for the run, a line for each event, and a last line that proves that no line is missing.
#include <fmt/compile.h>
#include <fmt/format.h>

#include <charconv>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "redag/base/lines.hpp"
#include "redag/base/text.hpp"
#include "redag/model/validate.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/events_form.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/run_info_json.hpp"

namespace redag::trace {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{1} << 20U;
constexpr std::size_t kMostFooterBytes = 4096;

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

std::optional<EventsFooter> read_footer(std::string_view line) {
  if (line.empty() || line.front() != '{' || json_is_too_large(line)) return std::nullopt;
  const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  const auto events = json.find("events");
  const auto end = json.find("end_ns");
  const auto lost = json.find("lost_events");
  if (events == json.end() || !events->is_number_unsigned() || end == json.end() || !end->is_number_integer() ||
      lost == json.end() || !lost->is_number_unsigned() || !is_a_time(end->get<std::int64_t>())) {
    return std::nullopt;
  }
  return EventsFooter{events->get<std::uint64_t>(), end->get<std::int64_t>(), lost->get<std::uint64_t>()};
}

class TextSink final : public EventsSink {
 public:
  TextSink(OutputFile file, const RunInfo &info) : file_(std::move(file)) { file_.write(events_header(info)); }

  void add(std::span<const JobEvent> events) override {
    std::string lines;
    for (const JobEvent &event : events) {
      append_event_line(event, lines);
      if (lines.size() < kChunkBytes) continue;
      file_.write(lines);
      lines.clear();
    }
    file_.write(lines);
    count_ += events.size();
  }

  Result<void> commit(Time end, std::uint64_t lost_events) override {
    file_.write(events_footer(count_, end, lost_events));
    return file_.commit();
  }

 private:
  OutputFile file_;
  std::uint64_t count_ = 0;
};

class TextSource final : public EventsSource {
 public:
  explicit TextSource(InputFile file) : file_(std::move(file)) {}

  Result<void> begin() {
    const Result<std::optional<EventsFooter>> last = footer_at_the_end();
    if (!last) return tl::unexpected<Diagnostics>(last.error());
    if (Result<void> header = read_header(); !header) return header;
    if (!*last) {  // an incomplete file: reading it finds the first mistake
      std::vector<JobEvent> ignored;
      for (;;) {
        const Result<bool> more = next(ignored);
        if (!more) return tl::unexpected<Diagnostics>(more.error());
        if (!*more) break;
      }
    }
    footer = **last;
    info.end = footer.end;
    info.lost_events = footer.lost_events;
    return {};
  }

  void rewind() override {
    offset_ = first_;
    line_ = 1;
    count_ = 0;
    seen_.reset();
  }

  Result<bool> next(std::vector<JobEvent> &events) override {
    events.clear();
    while (events.empty()) {
      const Result<std::string_view> lines = take_lines();
      if (!lines) return tl::unexpected<Diagnostics>(lines.error());
      if (lines->empty()) {
        if (Result<void> complete = check_end(); !complete) return tl::unexpected<Diagnostics>(complete.error());
        return false;
      }
      for (std::string_view rest = *lines; !rest.empty();) {
        if (Result<void> read = read_line(next_line(rest), events); !read)
          return tl::unexpected<Diagnostics>(std::move(read.error()));
      }
    }
    return true;
  }

 private:
  [[nodiscard]] tl::unexpected<Diagnostics> bad_line(std::string message, std::string hint = {}) const {
    return file_error(file_.name(), line_, std::move(message), std::move(hint));
  }

  Result<std::optional<EventsFooter>> footer_at_the_end() {
    const std::uint64_t begin = file_.size() - std::min<std::uint64_t>(file_.size(), kMostFooterBytes);
    const Result<std::string_view> read = file_.read(begin, kMostFooterBytes);
    if (!read) return tl::unexpected<Diagnostics>(read.error());
    std::string_view tail = *read;
    if (!tail.empty() && tail.back() == '\n') tail.remove_suffix(1);
    const std::size_t feed = tail.rfind('\n');
    if (feed == std::string_view::npos) return std::optional<EventsFooter>();
    return read_footer(tail.substr(feed + 1));
  }

  // Returns the next whole lines, or the rest of the file; nothing at its end.
  Result<std::string_view> take_lines() {
    for (std::size_t count = kChunkBytes;; count *= 2) {
      Result<std::string_view> chunk = file_.read(offset_, count);
      if (!chunk) return chunk;
      const bool is_rest = offset_ + chunk->size() >= file_.size() || chunk->size() < count;
      const std::size_t feed = chunk->rfind('\n');
      if (!is_rest && feed == std::string_view::npos) {
        if (count > kMaxInfoBytes) return bad_line("the line is longer than 64 MiB");
        continue;
      }
      const std::string_view lines = is_rest ? *chunk : chunk->substr(0, feed + 1);
      offset_ += lines.size();
      return lines;
    }
  }

  Result<void> read_header() {
    const Result<std::string_view> lines = take_lines();
    if (!lines) return tl::unexpected<Diagnostics>(lines.error());
    if (lines->empty()) return file_error(file_.name(), 0, "the file is empty");
    std::string_view rest = *lines;
    const std::string_view line = next_line(rest);
    offset_ -= rest.size();
    first_ = offset_;
    line_ = 1;
    Result<RunInfo> run = run_header_from_json(line, kTextFormat, "an event trace", file_.name());
    if (!run) return tl::unexpected<Diagnostics>(std::move(run.error()));
    info = *std::move(run);
    task_count_ = info.workload.task_count();
    return {};
  }

  Result<void> read_line(std::string_view line, std::vector<JobEvent> &events) {
    ++line_;
    if (seen_) return bad_line("there is text after the last line");
    JobEvent event;
    if (!line.empty() && line.front() == '{') {
      seen_ = read_footer(line);
      if (!seen_) return bad_line("the last line must have events, end_ns and lost_events");
    } else if (!read_event(line, event) || !has_valid_times(event)) {
      return bad_line("this line is not an event",
                      R"(an event is written as [time,"kind",task,job,worker,value,"reason"])");
    } else if (event.task.value >= task_count_) {
      return bad_line("task " + std::to_string(event.task.value) + " is not in the workload");
    } else {
      events.push_back(event);
      ++count_;
    }
    return {};
  }

  Result<void> check_end() const {
    if (!seen_) return bad_line("the file is incomplete: its last line is missing");
    if (seen_->events != count_) {
      return bad_line("the file has " + std::to_string(count_) + " events, but " + std::to_string(seen_->events) +
                      " were written");
    }
    if (seen_->end < info.start) return bad_line("the run ends before it begins");
    return {};
  }

  InputFile file_;
  std::uint64_t offset_ = 0;
  std::uint64_t first_ = 0;  // offset of the line after the run
  int line_ = 0;             // the last one that was read
  std::uint64_t count_ = 0;
  std::size_t task_count_ = 0;
  std::optional<EventsFooter> seen_;
};

}  // namespace

void append_event_line(const JobEvent &event, std::string &out) {
  const std::int64_t worker = event.worker == WorkerId::kNoneValue ? -1 : std::int64_t{event.worker};
  fmt::format_to(std::back_inserter(out), FMT_COMPILE("[{},\"{}\",{},{},{},{},\"{}\"]\n"), event.time,
                 to_string(event.kind), event.task.value, event.job, worker, event.value, to_string(event.reason));
}

std::string events_header(const RunInfo &info) { return run_header_to_json(kTextFormat, info) + "\n"; }

std::string events_footer(std::uint64_t events, Time end, std::uint64_t lost_events) {
  return fmt::format("{{\"events\":{},\"end_ns\":{},\"lost_events\":{}}}\n", events, end, lost_events);
}

std::unique_ptr<EventsSink> text_sink(OutputFile file, const RunInfo &info) {
  return std::make_unique<TextSink>(std::move(file), info);
}

Result<std::unique_ptr<EventsSource>> text_source(InputFile file) {
  auto source = std::make_unique<TextSource>(std::move(file));
  if (Result<void> begun = source->begin(); !begun) return tl::unexpected<Diagnostics>(std::move(begun.error()));
  return source;
}

}  // namespace redag::trace
