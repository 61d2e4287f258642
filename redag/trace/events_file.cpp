// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/events_file.hpp"

#include <algorithm>
#include <utility>

#include "redag/model/validate.hpp"
#include "redag/trace/events_form.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::trace {
namespace {

Result<std::unique_ptr<EventsSource>> source_of(InputFile file) {
  const Result<std::string_view> begin = file.read(0, kBlockMagic.size());
  if (!begin) return tl::unexpected<Diagnostics>(begin.error());
  // The last two bytes are those that a damaged copy has lost.
  constexpr std::size_t kName = kBlockFormat.size();
  if (begin->substr(0, kName) != kBlockFormat) return text_source(std::move(file));
  if (*begin == kBlockMagic) return block_source(std::move(file));
  return file_error(file.name(), 0, "byte 14: the file was copied as text, which changed its bytes", "copy it again");
}

Result<Trace> read_all(Result<EventsReader> reader, const std::string &file) {
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  Trace trace;
  trace.info = reader->info();
  std::vector<JobEvent> events;
  for (;;) {
    const Result<bool> more = reader->next(events);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) return trace;
    if (trace.events.size() + events.size() > kMostEventsInMemory) {
      return file_error(file, 0, "has more than " + std::to_string(kMostEventsInMemory) + " events",
                        "'redag check-trace' and 'redag events' read files of any length");
    }
    trace.events.insert(trace.events.end(), events.begin(), events.end());
  }
}

}  // namespace

EventsWriter::EventsWriter(std::unique_ptr<EventsSink> sink) : sink_(std::move(sink)) {}
EventsWriter::EventsWriter(EventsWriter &&) noexcept = default;
EventsWriter::~EventsWriter() = default;

Result<EventsWriter> EventsWriter::create(const std::string &path, const RunInfo &info) {
  Diagnostics mistakes = validate(info.workload, {.wcet_optional = true, .waits = true});
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  Result<OutputFile> file = OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return EventsWriter(path.ends_with(".redag") ? block_sink(*std::move(file), info)
                                               : text_sink(*std::move(file), info));
}

void EventsWriter::add(std::span<const JobEvent> events) { sink_->add(events); }

Result<void> EventsWriter::commit(Time end, std::uint64_t lost_events) { return sink_->commit(end, lost_events); }

EventsReader::EventsReader(std::unique_ptr<EventsSource> source) : source_(std::move(source)) {}
EventsReader::EventsReader(EventsReader &&) noexcept = default;
EventsReader::~EventsReader() = default;

Result<EventsReader> EventsReader::make(Result<std::unique_ptr<EventsSource>> source) {
  if (!source) return tl::unexpected<Diagnostics>(std::move(source.error()));
  return EventsReader(*std::move(source));
}

Result<EventsReader> EventsReader::open(const std::string &path) {
  Result<InputFile> file = InputFile::open(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return make(source_of(*std::move(file)));
}

Result<EventsReader> EventsReader::of(std::string_view bytes, const std::string &file) {
  return make(source_of(InputFile(bytes, file)));
}

const RunInfo &EventsReader::info() const { return source_->info; }
std::uint64_t EventsReader::events() const { return source_->footer.events; }

Result<bool> EventsReader::next(std::vector<JobEvent> &events) { return source_->next(events); }

void EventsReader::rewind() { source_->rewind(); }

Result<void> EventsReader::visit(const std::function<void(std::span<const JobEvent>)> &visit) {
  std::vector<JobEvent> events;
  for (;;) {
    const Result<bool> more = next(events);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) return {};
    visit(events);
  }
}

Result<void> write_trace(const std::string &path, const Trace &trace) {
  Result<EventsWriter> writer = EventsWriter::create(path, trace.info);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  writer->add(trace.events);
  return writer->commit(trace.info.end, trace.info.lost_events);
}

Result<Trace> read_trace(const std::string &path) { return read_all(EventsReader::open(path), path); }

Result<Trace> parse_trace(std::string_view bytes, const std::string &file) {
  return read_all(EventsReader::of(bytes, file), file);
}

}  // namespace redag::trace
