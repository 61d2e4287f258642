// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/kernel_record.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>
#include <type_traits>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/input_file.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::metrics {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kKernelFormat = "redag.kernel/2";
constexpr int kGzip = 15 + 16;     // zlib's window bits for its own form of gzip
constexpr int kAnyForm = 15 + 32;  // recognise the form
constexpr int kLevel = 1;          // the run goes on meanwhile
constexpr std::size_t kChunk = std::size_t{1} << 16U;
constexpr std::size_t kLongestLine = std::size_t{1} << 16U;

bool is_time(const Json &value) {
  if (!value.is_number_integer()) return false;
  const auto time = value.get<std::int64_t>();
  return time >= -trace::kMaxTraceTime && time <= trace::kMaxTraceTime;
}

bool are_integers(const Json &row, std::initializer_list<std::size_t> places) {
  return std::all_of(places.begin(), places.end(), [&](std::size_t i) { return row[i].is_number_integer(); });
}

// Reads a line such as ["switch",time,cpu,from,runnable,to,priority]. Returns nothing if it is none.
std::optional<KernelRow> row_of(const Json &row) {
  if (!row.is_array() || row.empty() || !row[0].is_string()) return std::nullopt;
  const std::string_view kind = row[0].get_ref<const std::string &>();
  if (kind == "switch") {
    if (row.size() != 7 || !is_time(row[1]) || !are_integers(row, {2, 3, 5, 6}) || !row[4].is_boolean()) return {};
    return KernelSwitch{row[1], row[2], row[3], row[4], row[5], row[6]};
  }
  if (kind == "interrupt") {
    if (row.size() != 5 || !is_time(row[1]) || !is_time(row[2]) || !are_integers(row, {3}) || !row[4].is_string())
      return {};
    if (row[2].get<Time>() < row[1].get<Time>()) return {};
    return KernelInterrupt{row[1], row[2], row[3], row[4]};
  }
  if (kind == "job") {
    if (row.size() != 4 || !row[1].is_number_unsigned() || !row[2].is_number_unsigned() || !are_integers(row, {3}))
      return {};
    return JobThread{TaskId(row[1].get<std::uint32_t>()), row[2], row[3]};
  }
  if (kind == "thread") {
    if (row.size() != 4 || !are_integers(row, {1, 3}) || !row[2].is_string()) return {};
    return KernelThread{row[1], row[2], row[3]};
  }
  if (kind == "process") {
    if (row.size() != 3 || !are_integers(row, {1}) || !row[2].is_string() || row[1].get<int>() == 0) return {};
    return KernelProcess{row[1], row[2]};
  }
  if (kind != "lost" || row.size() != 2 || !row[1].is_number_unsigned()) return {};
  return KernelLoss{row[1]};
}

std::string quoted(const std::string &text) { return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

std::optional<Time> time_of(const KernelRow &row) {
  if (const auto *one = std::get_if<KernelSwitch>(&row)) return one->time;
  if (const auto *one = std::get_if<KernelInterrupt>(&row)) return one->end;
  return std::nullopt;
}

std::string kernel_line(const KernelRow &row) {
  return std::visit(
      [](const auto &one) {
        using Row = std::decay_t<decltype(one)>;
        if constexpr (std::is_same_v<Row, KernelSwitch>) {
          return fmt::format("[\"switch\",{},{},{},{},{},{}]\n", one.time, one.cpu, one.from, one.runnable, one.to,
                             one.to_priority);
        } else if constexpr (std::is_same_v<Row, KernelInterrupt>) {
          return fmt::format("[\"interrupt\",{},{},{},{}]\n", one.begin, one.end, one.cpu, quoted(one.name));
        } else if constexpr (std::is_same_v<Row, KernelProcess>) {
          return fmt::format("[\"process\",{},{}]\n", one.process, quoted(one.name));
        } else if constexpr (std::is_same_v<Row, KernelThread>) {
          return fmt::format("[\"thread\",{},{},{}]\n", one.thread, quoted(one.name), one.process);
        } else if constexpr (std::is_same_v<Row, JobThread>) {
          return fmt::format("[\"job\",{},{},{}]\n", one.task.value, one.number, one.thread);
        } else {
          return fmt::format("[\"lost\",{}]\n", one.events);
        }
      },
      row);
}

class KernelWriter::Impl {
 public:
  explicit Impl(trace::OutputFile file) : file_(std::move(file)) {
    const int status = ::deflateInit2(&stream_, kLevel, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY);
    REDAG_CHECK(status == Z_OK, "zlib has no memory");
  }
  ~Impl() { ::deflateEnd(&stream_); }
  Impl(const Impl &) = delete;
  Impl &operator=(const Impl &) = delete;

  void write(std::string_view text) {
    text_ += text;
    if (text_.size() >= kChunk) compress(Z_NO_FLUSH);
  }

  Result<void> commit() {
    compress(Z_FINISH);
    return file_.commit();
  }

 private:
  void compress(int flush) {
    stream_.next_in = reinterpret_cast<Bytef *>(text_.data());
    stream_.avail_in = static_cast<uInt>(text_.size());
    do {
      stream_.next_out = reinterpret_cast<Bytef *>(out_.data());
      stream_.avail_out = static_cast<uInt>(out_.size());
      static_cast<void>(::deflate(&stream_, flush));
      file_.write({out_.data(), out_.size() - stream_.avail_out});
    } while (stream_.avail_out == 0);
    text_.clear();
  }

  trace::OutputFile file_;
  z_stream stream_{};
  std::string text_;
  std::array<char, kChunk> out_{};
};

KernelWriter::KernelWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
KernelWriter::KernelWriter(KernelWriter &&) noexcept = default;
KernelWriter &KernelWriter::operator=(KernelWriter &&) noexcept = default;
KernelWriter::~KernelWriter() = default;

Result<KernelWriter> KernelWriter::create(const std::string &path, const Provenance &run) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  KernelWriter writer(std::make_unique<Impl>(*std::move(file)));
  writer.impl_->write(fmt::format("{{\"format\":\"{}\",\"provenance\":{}}}\n", kKernelFormat, provenance_to_json(run)));
  return writer;
}

void KernelWriter::add(const KernelRow &row) { impl_->write(kernel_line(row)); }

Result<void> KernelWriter::commit() {
  impl_->write("{\"end\":true}\n");
  return impl_->commit();
}

class KernelReader::Impl {
 public:
  explicit Impl(trace::InputFile file) : file_(std::move(file)) {
    // A file that was decompressed by hand is read as it is.
    const Result<std::string_view> first = file_.read(0, 1);
    is_plain_ = first && !first->empty() && first->front() == '{';
    if (is_plain_) return;
    const int status = ::inflateInit2(&stream_, kAnyForm);
    REDAG_CHECK(status == Z_OK, "zlib has no memory");
  }
  ~Impl() {
    if (!is_plain_) ::inflateEnd(&stream_);
  }
  Impl(const Impl &) = delete;
  Impl &operator=(const Impl &) = delete;

  Result<Provenance> head() {
    const Result<std::optional<std::string_view>> line = next_line();
    const Json json = line && *line ? parsed(**line) : Json();
    if (!json.is_object() || json.value("format", Json()) != kKernelFormat) {
      return error("this is not a kernel's record of a run", "'redag run --kernel' writes one");
    }
    Result<Provenance> run = provenance_from_json(json.value("provenance", Json::object()).dump());
    if (!run) return error("the provenance is not an object of texts");
    return run;
  }

  Result<std::optional<KernelRow>> next() {
    const Result<std::optional<std::string_view>> line = next_line();
    if (!line) return tl::unexpected<Diagnostics>(line.error());
    if (is_complete_) {
      if (*line) return error("there is text after the last line");
      return std::optional<KernelRow>();
    }
    if (!*line) return error("the file is incomplete: its last line is missing");
    const Json json = parsed(**line);
    if (json.is_object() && json.contains("end")) {
      is_complete_ = true;
      return next();
    }
    std::optional<KernelRow> row = row_of(json);
    const std::optional<Time> time = row ? time_of(*row) : std::nullopt;
    if (!row || (time && *time < last_)) return error("this line is no event of the kernel, or not in order of time");
    if (time) last_ = *time;
    return row;
  }

 private:
  static Json parsed(std::string_view line) {
    return json_is_too_large(line) ? Json() : Json::parse(line, nullptr, false);
  }

  [[nodiscard]] tl::unexpected<Diagnostics> error(std::string message, std::string hint = {}) const {
    return trace::file_error(file_.name(), number_, std::move(message), std::move(hint));
  }

  // The next line without its line feed, valid until the next call. Nothing after the last one.
  Result<std::optional<std::string_view>> next_line() {
    ++number_;
    for (;;) {
      const std::size_t end = text_.find('\n', at_);
      if (end != std::string::npos) {
        const std::string_view line = std::string_view(text_).substr(at_, end - at_);
        at_ = end + 1;
        return std::optional(line);
      }
      text_.erase(0, std::exchange(at_, 0));
      if (text_.size() > kLongestLine) return error("this line is too long for an event of the kernel");
      const std::size_t before = text_.size();
      if (Result<void> more = load(); !more) return tl::unexpected<Diagnostics>(std::move(more.error()));
      if (text_.size() > before) continue;
      if (text_.empty()) return std::optional<std::string_view>();
      at_ = text_.size();
      return std::optional(std::string_view(text_));
    }
  }

  // Appends text of the file. Appends none at its end.
  Result<void> load() {
    for (;;) {
      const Result<std::string_view> bytes = file_.read(offset_, kChunk);
      if (!bytes) return tl::unexpected<Diagnostics>(bytes.error());
      if (is_plain_) {
        text_ += *bytes;
        offset_ += bytes->size();
        return {};
      }
      if (is_over_) {
        if (bytes->empty()) return {};
        return error("there are bytes after the compressed text");
      }
      std::array<char, kChunk> out;
      stream_.next_in = reinterpret_cast<Bytef *>(const_cast<char *>(bytes->data()));
      stream_.avail_in = static_cast<uInt>(bytes->size());
      stream_.next_out = reinterpret_cast<Bytef *>(out.data());
      stream_.avail_out = static_cast<uInt>(out.size());
      const int status = ::inflate(&stream_, Z_NO_FLUSH);
      offset_ += bytes->size() - stream_.avail_in;
      text_.append(out.data(), out.size() - stream_.avail_out);
      is_over_ = status == Z_STREAM_END;
      if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) {
        return error("the compressed text is damaged", "copy the file again");
      }
      if (stream_.avail_out < out.size()) return {};
      if (bytes->empty() && !is_over_) return error("the file is incomplete: its compressed text ends early");
    }
  }

  trace::InputFile file_;
  bool is_plain_ = false;
  bool is_over_ = false;      // the compressed text has ended
  bool is_complete_ = false;  // the last line was read
  z_stream stream_{};
  std::uint64_t offset_ = 0;  // in the file
  std::string text_;          // some of the lines
  std::size_t at_ = 0;        // in the text: the next line
  int number_ = 0;            // of the last line
  Time last_ = std::numeric_limits<Time>::min();
};

KernelReader::KernelReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
KernelReader::KernelReader(KernelReader &&) noexcept = default;
KernelReader &KernelReader::operator=(KernelReader &&) noexcept = default;
KernelReader::~KernelReader() = default;

Result<std::optional<KernelRow>> KernelReader::next() { return impl_->next(); }

Result<KernelRecord> KernelRecord::open(const std::string &path) {
  KernelRecord record;
  record.path_ = path;
  return opened(std::move(record));
}

Result<KernelRecord> KernelRecord::of(std::string bytes, const std::string &file) {
  KernelRecord record;
  record.path_ = file;
  record.bytes_ = std::make_shared<const std::string>(std::move(bytes));
  return opened(std::move(record));
}

Result<std::optional<KernelRecord>> KernelRecord::beside(const std::string &trace, const trace::RunInfo &run) {
  const std::string path = (std::filesystem::path(trace).parent_path() / kKernelFile).string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::optional<KernelRecord>();
  Result<KernelRecord> record = open(path);
  if (!record) return tl::unexpected<Diagnostics>(std::move(record.error()));
  if (!(record->run_ == run.provenance)) return std::optional<KernelRecord>();
  return std::optional<KernelRecord>(*std::move(record));
}

Result<KernelRecord> KernelRecord::opened(KernelRecord record) {
  Result<KernelReader> reader = record.begin();
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  Result<Provenance> run = reader->impl_->head();
  if (!run) return tl::unexpected<Diagnostics>(std::move(run.error()));
  record.run_ = *std::move(run);
  return record;
}

Result<KernelReader> KernelRecord::begin() const {
  Result<trace::InputFile> file =
      bytes_ ? Result<trace::InputFile>(trace::InputFile(*bytes_, path_)) : trace::InputFile::open(path_);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return KernelReader(std::make_unique<KernelReader::Impl>(*std::move(file)));
}

Result<KernelReader> KernelRecord::read() const {
  Result<KernelReader> reader = begin();
  if (!reader) return reader;
  const Result<Provenance> run = reader->impl_->head();
  if (!run) return tl::unexpected<Diagnostics>(run.error());
  if (!(*run == run_)) return trace::file_error(path_, 1, "the file is of another run than a moment ago");
  return reader;
}

}  // namespace redag::metrics
