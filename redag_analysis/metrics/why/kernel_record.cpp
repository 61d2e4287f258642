// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/kernel_record.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <system_error>

namespace redag::metrics {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 16U;
constexpr std::size_t kLongestLine = std::size_t{1} << 16U;

std::optional<std::int64_t> number(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end == text.data()) return std::nullopt;
  return value;
}

std::optional<int> small_number(std::string_view text) {
  const std::optional<std::int64_t> value = number(text);
  if (!value || *value < 0 || *value > 1'000'000'000) return std::nullopt;
  return static_cast<int>(*value);
}

// The text between the last `name` and the next space; empty if there is none. Names of threads can hold anything, and
// stand before the numbers.
std::string_view field(std::string_view fields, std::string_view name) {
  const std::size_t at = fields.rfind(name);
  if (at == std::string_view::npos) return {};
  fields.remove_prefix(at + name.size());
  return fields.substr(0, fields.find(' '));
}

// "1234.567890" or "1234.567890123" in nanoseconds.
std::optional<Time> time_in(std::string_view text) {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos) return std::nullopt;
  const std::string_view digits = text.substr(point + 1);
  const auto seconds = number(text.substr(0, point));
  const auto fraction = number(digits);
  if (!seconds || !fraction || *seconds < 0 || *seconds > kMaxDuration / kSecond - 1 || *fraction < 0) return {};
  if (digits.size() == 6) return *seconds * kSecond + *fraction * kMicrosecond;
  if (digits.size() == 9) return *seconds * kSecond + *fraction;
  return std::nullopt;
}

struct ThreadText {
  std::string_view name;
  std::optional<int> thread;
  std::optional<int> priority;
};

// "prev_comm=redag-0 prev_pid=77 prev_prio=48 prev_state=R ==> next_comm=..." of tracefs and perf.
std::optional<KernelSwitch> labelled_switch(std::string_view fields) {
  const std::size_t arrow = fields.rfind(" ==> next_comm=");
  if (arrow == std::string_view::npos) return std::nullopt;
  const std::string_view previous = fields.substr(0, arrow);
  const std::string_view next = fields.substr(arrow + 15);
  const auto from = small_number(field(previous, " prev_pid="));
  const auto to = small_number(field(next, " next_pid="));
  const auto priority = small_number(field(next, " next_prio="));
  const std::string_view state = field(previous, " prev_state=");
  if (!from || !to || !priority || state.empty()) return std::nullopt;
  return KernelSwitch{.from = *from,
                      .runnable = state.front() == 'R',
                      .to = *to,
                      .to_priority = *priority,
                      .to_name = std::string(next.substr(0, next.rfind(" next_pid=")))};
}

// "redag-0:77 [48]" of trace-cmd.
ThreadText short_thread(std::string_view text) {
  const std::size_t bracket = text.rfind(" [");
  const std::size_t colon = text.rfind(':', bracket);
  if (bracket == std::string_view::npos || colon == std::string_view::npos) return {};
  return {text.substr(0, colon), small_number(text.substr(colon + 1)), small_number(text.substr(bracket + 2))};
}

// "redag-0:77 [48] R ==> stress:99 [120]" of trace-cmd.
std::optional<KernelSwitch> short_switch(std::string_view fields) {
  const std::size_t arrow = fields.rfind(" ==> ");
  const std::size_t bracket = fields.rfind("] ", arrow);
  if (arrow == std::string_view::npos || bracket == std::string_view::npos || bracket + 2 >= arrow) return std::nullopt;
  const ThreadText previous = short_thread(fields.substr(0, bracket));
  const ThreadText next = short_thread(fields.substr(arrow + 5));
  if (!previous.thread || !next.thread || !next.priority) return std::nullopt;
  return KernelSwitch{.from = *previous.thread,
                      .runnable = fields[bracket + 2] == 'R',
                      .to = *next.thread,
                      .to_priority = *next.priority,
                      .to_name = std::string(next.name)};
}

// The name of an interrupt: "virtio0" of "irq=25 name=virtio0", "TIMER" of "vec=1 [action=TIMER]".
std::string name_of(std::string_view fields, bool soft) {
  std::string name(soft ? field(fields, "[action=") : fields.substr(std::min(fields.size(), fields.find("name=") + 5)));
  if (soft && !name.empty() && name.back() == ']') name.pop_back();
  return soft ? "softirq " + name : name;
}

}  // namespace

Time time_of(const KernelRow &row) {
  const auto *const interrupt = std::get_if<KernelInterrupt>(&row);
  return interrupt != nullptr ? interrupt->end : std::get<KernelSwitch>(row).time;
}

Result<std::optional<KernelRow>> KernelReader::next() {
  for (;;) {
    const Result<std::optional<std::string_view>> line = next_line();
    if (!line) return tl::unexpected<Diagnostics>(line.error());
    if (!*line) return std::optional<KernelRow>();
    std::optional<KernelRow> row = read(**line);
    if (!row) continue;
    if (last_ && time_of(*row) < *last_) {
      ++lost_;
      continue;
    }
    last_ = time_of(*row);
    return row;
  }
}

// The next line without its line feed, valid until the next call. Nothing after the last one.
Result<std::optional<std::string_view>> KernelReader::next_line() {
  for (;;) {
    const std::size_t end = text_.find('\n', at_);
    if (end != std::string::npos) {
      const std::string_view line = std::string_view(text_).substr(at_, end - at_);
      at_ = end + 1;
      return std::optional(line);
    }
    text_.erase(0, std::exchange(at_, 0));
    if (text_.size() > kLongestLine) text_.clear();  // no event of the kernel
    const Result<std::string_view> more = file_.read(offset_, kChunk);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (more->empty()) return std::optional<std::string_view>();
    text_ += *more;
    offset_ += more->size();
  }
}

// A line such as "  redag-0-77  [001] d..2.  12.345678: sched_switch: prev_comm=... ==> next_comm=...". perf writes the
// event as "sched:sched_switch:".
std::optional<KernelRow> KernelReader::read(std::string_view line) {
  if (line.starts_with("CPU:")) {
    const std::size_t bracket = line.find('[');
    const std::size_t digits = line.find_first_of("0123456789", bracket);  // "[LOST 12 EVENTS]", "[12 EVENTS DROPPED]"
    if (bracket != std::string_view::npos && digits != std::string_view::npos &&
        line.find("EVENTS", digits) != line.npos)
      lost_ += static_cast<std::uint64_t>(small_number(line.substr(digits)).value_or(0));
    return std::nullopt;
  }
  constexpr std::array<std::string_view, 5> kEvents = {
      "sched_switch:", "irq_handler_entry:", "irq_handler_exit:", "softirq_entry:", "softirq_exit:"};
  for (const std::string_view event : kEvents) {
    const std::size_t at = line.find(event);
    if (at == std::string_view::npos) continue;
    const std::string_view head = line.substr(0, at);
    const std::size_t colon = head.find_last_not_of("schedirq: ");  // the last digit of the time
    const std::size_t blank = head.rfind(' ', colon);
    const std::size_t bracket = head.rfind('[');
    if (colon == std::string_view::npos || blank == std::string_view::npos || bracket == std::string_view::npos)
      return {};
    const std::optional<Time> time = time_in(head.substr(blank + 1, colon - blank));
    const std::optional<int> cpu = small_number(head.substr(bracket + 1));
    std::string_view fields = line.substr(at + event.size());
    fields.remove_prefix(std::min(fields.size(), fields.find_first_not_of(' ')));
    if (!time || !cpu) return std::nullopt;
    if (event != kEvents[0]) return read_interrupt(event, *time - origin_, *cpu, fields);
    std::optional<KernelSwitch> found = labelled_switch(fields);
    if (!found) found = short_switch(fields);
    if (!found) return std::nullopt;
    found->time = *time - origin_;
    found->cpu = *cpu;
    return *std::move(found);
  }
  return std::nullopt;
}

std::optional<KernelRow> KernelReader::read_interrupt(std::string_view event, Time time, int cpu,
                                                      std::string_view fields) {
  const bool soft = event.starts_with("softirq");
  const std::pair key(cpu, soft);
  if (event.ends_with("entry:")) {
    open_[key] = {time, time, cpu, name_of(fields, soft)};
    return std::nullopt;
  }
  const auto begun = open_.find(key);
  if (begun == open_.end() || time < begun->second.begin) return std::nullopt;
  KernelInterrupt interrupt = std::move(begun->second);
  open_.erase(begun);
  interrupt.end = time;
  return interrupt;
}

Result<KernelRecord> KernelRecord::open(const std::string &path, Time origin) {
  const Result<trace::InputFile> file = trace::InputFile::open(path);
  if (!file) return tl::unexpected<Diagnostics>(file.error());
  KernelRecord record;
  record.path_ = path;
  record.origin_ = origin;
  return record;
}

KernelRecord KernelRecord::of(std::string text, Time origin) {
  KernelRecord record;
  record.path_ = "kernel.txt";
  record.bytes_ = std::make_shared<const std::string>(std::move(text));
  record.origin_ = origin;
  return record;
}

Result<KernelReader> KernelRecord::read() const {
  if (bytes_) return KernelReader(trace::InputFile(*bytes_, path_), bytes_, origin_);
  Result<trace::InputFile> file = trace::InputFile::open(path_);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return KernelReader(*std::move(file), nullptr, origin_);
}

}  // namespace redag::metrics
