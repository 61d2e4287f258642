// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/calibration.hpp"

#include <array>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml_values.hpp"
#include "redag/loader/yaml_writer.hpp"

namespace redag {
namespace {

using yaml::find;
using yaml::Node;
using yaml::Writer;

constexpr std::size_t kMaxBytes = std::size_t{1} << 20U;

constexpr std::array<std::pair<const char *, std::string Calibration::*>, 6> kProvenanceTexts = {
    {{"date", &Calibration::date},
     {"host", &Calibration::host},
     {"kernel", &Calibration::kernel},
     {"processor", &Calibration::processor},
     {"rights", &Calibration::rights},
     {"version", &Calibration::version}}};

class OverheadsReader : private yaml::ValueReader {
 public:
  OverheadsReader(const Node &root, std::string file) : ValueReader(std::move(file)), root_(root) {}

  Result<Calibration> run() {
    if (check_map(root_, "an overheads file", {"overheads", "provenance"})) {
      read_overheads();
      read_provenance();
    }
    Diagnostics mistakes = take_diagnostics();
    if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
    return std::move(calibration_);
  }

 private:
  void read_overheads() {
    const Node *node = find(root_, "overheads");
    if (node == nullptr) {
      error(root_, "the key 'overheads' is missing", "'redag doctor --measure --out FILE' writes an overheads file");
      return;
    }
    if (!check_map(*node, "overheads", {"realtime", "normal"})) return;
    if (const Node *one = find(*node, "realtime")) calibration_.realtime = read_class(*one, "realtime");
    if (const Node *one = find(*node, "normal")) calibration_.normal = read_class(*one, "normal");
    if (!calibration_.realtime && !calibration_.normal) {
      error(*node, "overheads must have 'realtime', 'normal', or both");
    }
  }

  Overheads read_class(const Node &node, std::string_view what) {
    Overheads overheads;
    if (!check_map(node, what, overhead_names())) return overheads;
    for (const std::string_view name : overhead_names()) {
      const Node *value = find(node, name);
      if (value == nullptr) {
        error(node, fmt::format("{} has no '{}'", what, name),
              "write 0 for an overhead that the machine does not have");
        continue;
      }
      *overhead_named(overheads, name) = duration_from_zero(*value, name).value_or(0);
    }
    for (const std::string_view name : {"stall_per_second", "noise_per_second"}) {
      if (*overhead_named(overheads, name) >= kSecond)
        error(node, fmt::format("{} must be below one second per second", name));
    }
    return overheads;
  }

  void read_provenance() {
    const Node *node = find(root_, "provenance");
    if (node == nullptr) return;
    std::vector<std::string_view> keys = {"processors", "duration", "complete"};
    for (const auto &[key, text] : kProvenanceTexts) keys.emplace_back(key);
    if (!check_map(*node, "provenance", keys)) return;
    for (const auto &[key, text] : kProvenanceTexts) take(*node, key, calibration_.*text);
    take(*node, "processors", calibration_.processors, 0, std::numeric_limits<std::uint32_t>::max());
    take(*node, "duration", calibration_.duration, 0);
    if (const Node *value = find(*node, "complete")) {
      if (value->text == "true" || value->text == "false") {
        calibration_.complete = value->text == "true";
      } else {
        wrong_type(*value, "complete", "true or false");
      }
    }
  }

  const Node &root_;
  Calibration calibration_;
};

void write(Writer &out, std::string_view key, const std::optional<Overheads> &overheads) {
  if (!overheads) return;
  Overheads copy = *overheads;
  out.text(key);
  out.begin_map();
  for (const std::string_view name : overhead_names()) out.write(name, format_duration(*overhead_named(copy, name)));
  out.end_map();
}

}  // namespace

std::string Calibration::provenance() const {
  std::string text = fmt::format("calibrated {} on {}", date.empty() ? "on an unknown day" : date,
                                 host.empty() ? "an unknown host" : host);
  if (duration > 0) text += ", " + humanize_duration(duration);
  return text + (complete ? "" : ", partial: ended early");
}

Result<Overheads> Calibration::of(bool realtime_threads) const {
  const std::optional<Overheads> &found = realtime_threads ? realtime : normal;
  if (found) return *found;
  return realtime_threads
             ? make_error(
                   "the calibration has no overheads of SCHED_FIFO threads",
                   "run 'redag doctor --measure' in a process that may use SCHED_FIFO, or use --preemption cooperative "
                   "or none")
             : make_error("the calibration has no overheads of ordinary threads", "run 'redag doctor --measure' again");
}

std::string to_yaml(const Calibration &calibration) {
  Writer out;
  out.begin_map();
  out.text("overheads");
  out.begin_map();
  write(out, "realtime", calibration.realtime);
  write(out, "normal", calibration.normal);
  out.end_map();
  out.text("provenance");
  out.begin_map();
  for (const auto &[key, text] : kProvenanceTexts) {
    out.text(key);
    out.quoted(calibration.*text);
  }
  out.write("processors", calibration.processors);
  out.write("duration", format_duration(calibration.duration));
  out.write("complete", calibration.complete ? "true" : "false");
  out.end_map();
  out.end_map();
  return "# What this machine adds to the jobs of a workload: docs/calibration.md. Charged with --overheads FILE.\n" +
         out.take();
}

Result<Calibration> parse_calibration(std::string_view text, std::string file_name) {
  if (text.size() > kMaxBytes) return file_error(file_name, 0, "too large for an overheads file");
  const Result<Node> root = yaml::parse(text, file_name);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return OverheadsReader(*root, std::move(file_name)).run();
}

Result<Calibration> load_calibration(const std::filesystem::path &path) {
  const Result<std::string> text = read_file(path.string(), kMaxBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_calibration(*text, path.string());
}

}  // namespace redag
