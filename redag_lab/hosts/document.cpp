// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "redag/base/provenance.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_lab/report/curves.hpp"

namespace redag::hosts {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kFormat = "redag.hosts/1";

const char *to_string(Sentence::Tone tone) {
  switch (tone) {
    case Sentence::Tone::Good: return "good";
    case Sentence::Tone::Bad: return "bad";
    case Sentence::Tone::Caution: return "caution";
    case Sentence::Tone::Plain: return "plain";
  }
  return "plain";
}

Json to_json(const Interval &interval) { return Json{{"low_ns", interval.low}, {"high_ns", interval.high}}; }

// How many of the answers had one end of their bounds by each time.
Json curve_of(const std::vector<Interval> &answers, Duration Interval::*end) {
  std::vector<Duration> values;
  values.reserve(answers.size());
  for (const Interval &answer : answers) values.push_back(answer.*end);
  std::sort(values.begin(), values.end());
  Json curve{{"value_ns", Json::array()}, {"count", Json::array()}};
  if (values.empty()) return curve;
  for (const report::CurvePoint &point : report::curve_of(values)) {
    curve["value_ns"].push_back(point.value);
    curve["count"].push_back(point.count);
  }
  return curve;
}

Json to_json(const Host &host, Time end) {
  const Time own_end = std::min(end - host.shift, host.info.end);
  return Json{
      {"name", host.name},
      {"result", host.path},
      {"clock", host.clock_by},
      {"shift_ns", host.shift},
      {"offset_at_start", to_json(host.clock.at(host.info.start))},
      {"offset_at_end", to_json(host.clock.at(own_end))},
      {"clock_error_ns", host.clock.error()},
      {"within_ns", host.clock.within()},
      {"provenance", host.info.provenance.is_known() ? Json::parse(provenance_to_json(host.info.provenance)) : Json()}};
}

Json to_json(const Chain &chain, const ChainFigures &figures, const MergedRun &merged) {
  Json links = Json::array();
  for (const Crossing &link : chain.links) {
    links.push_back(Json{{"from", link.from.value}, {"to", link.to.value}, {"transport_ns", link.transport}});
  }
  Json worst = Json::array();
  for (const Answer &answer : figures.worst) {
    Json row{{"job", answer.job},
             {"finish_ns", answer.finish - merged.info.start},
             {"low_ns", answer.latency.low},
             {"high_ns", answer.latency.high},
             {"ambiguous", answer.is_ambiguous}};
    row["verdict"] = chain.deadline > 0 ? Json(to_string(judge(answer.latency, chain.deadline))) : Json();
    worst.push_back(std::move(row));
  }
  return Json{{"name", chain.name},
              {"sink", chain.sink.value},
              {"links", std::move(links)},
              {"deadline_ns", chain.deadline > 0 ? Json(chain.deadline) : Json()},
              {"answers", figures.answers},
              {"met", figures.count(Verdict::Met)},
              {"missed", figures.count(Verdict::Missed)},
              {"unknown", figures.count(Verdict::Unknown)},
              {"ambiguous", figures.ambiguous},
              {"unmatched", figures.unmatched},
              {"shortest", to_json(figures.shortest)},
              {"longest", to_json(figures.longest)},
              {"widest_ns", figures.widest},
              {"drawn", figures.first.size()},
              {"low", curve_of(figures.first, &Interval::low)},
              {"high", curve_of(figures.first, &Interval::high)},
              {"worst", std::move(worst)}};
}

// Checks what a page takes for granted.
class Checker {
 public:
  static bool is_document(const Json &json) {
    return json.is_object() && has_all(json, "hosts", is_host) && has_all(json, "chains", is_chain) &&
           has_all(json, "words", [](const Json &word) { return has_text(word, "tone") && has_text(word, "text"); });
  }

 private:
  template <class Check>
  static bool has_all(const Json &json, const char *key, Check check) {
    return json.contains(key) && json[key].is_array() &&
           std::all_of(json[key].begin(), json[key].end(),
                       [&](const Json &item) { return item.is_object() && check(item); });
  }
  static bool has_text(const Json &json, const char *key) { return json.contains(key) && json[key].is_string(); }
  static bool has_number(const Json &json, const char *key) {
    return json.contains(key) && json[key].is_number_integer();
  }
  static bool has_interval(const Json &json, const char *key) {
    return json.contains(key) && json[key].is_object() && has_number(json[key], "low_ns") &&
           has_number(json[key], "high_ns");
  }
  static bool has_numbers(const Json &json, const char *key) {
    return json.contains(key) && json[key].is_array() &&
           std::all_of(json[key].begin(), json[key].end(), [](const Json &item) { return item.is_number_integer(); });
  }
  static bool has_curve(const Json &json, const char *key) {
    return json.contains(key) && json[key].is_object() && has_numbers(json[key], "value_ns") &&
           has_numbers(json[key], "count") && json[key]["value_ns"].size() == json[key]["count"].size();
  }
  static bool is_host(const Json &host) {
    return has_text(host, "name") && has_text(host, "clock") && has_number(host, "shift_ns") &&
           has_number(host, "within_ns") && has_interval(host, "offset_at_start") &&
           has_interval(host, "offset_at_end");
  }
  static bool is_answer(const Json &answer) {
    return has_number(answer, "job") && has_number(answer, "finish_ns") && has_number(answer, "low_ns") &&
           has_number(answer, "high_ns") && answer.contains("verdict");
  }
  static bool is_chain(const Json &chain) {
    for (const char *key : {"answers", "met", "missed", "unknown", "ambiguous", "unmatched", "widest_ns", "drawn"}) {
      if (!has_number(chain, key)) return false;
    }
    return has_text(chain, "name") && chain.contains("deadline_ns") &&
           (chain["deadline_ns"].is_null() || has_number(chain, "deadline_ns")) && has_interval(chain, "shortest") &&
           has_interval(chain, "longest") && has_curve(chain, "low") && has_curve(chain, "high") &&
           has_all(chain, "worst", is_answer);
  }
};

void add_verdicts(const Chain &chain, const ChainFigures &figures, std::vector<Sentence> &all) {
  const std::uint64_t missed = figures.count(Verdict::Missed);
  const std::uint64_t unknown = figures.count(Verdict::Unknown);
  const std::string deadline = format_duration(chain.deadline);
  if (missed > 0) {
    all.push_back(
        {Sentence::Tone::Bad,
         fmt::format("{}: {} of the answers missed the deadline {}, whatever the clocks were within their uncertainty",
                     chain.name, format_share(missed, figures.answers), deadline)});
  }
  if (unknown > 0) {
    all.push_back(
        {Sentence::Tone::Caution,
         fmt::format("{}: {} of the answers cannot be told: the deadline {} is within the uncertainty of the clocks",
                     chain.name, format_share(unknown, figures.answers), deadline)});
  }
  if (missed + unknown == 0) {
    all.push_back({Sentence::Tone::Good,
                   fmt::format("{}: all {} answers met the deadline {}, also with the uncertainty of the clocks",
                               chain.name, format_count(figures.answers), deadline)});
  }
}

}  // namespace

std::string describe(const Interval &interval) {
  const std::string low = humanize_duration(interval.low);
  const std::string high = humanize_duration(interval.high);
  return low == high ? low : fmt::format("from {} to {}", low, high);
}

std::vector<Sentence> sentences_of(const ChainWatch &watch) {
  std::vector<Sentence> all;
  for (std::size_t c = 0; c < watch.chains().size(); ++c) {
    const Chain &chain = watch.chains()[c];
    const ChainFigures &figures = watch.figures()[c];
    if (figures.answers == 0) {
      all.push_back({Sentence::Tone::Caution, fmt::format("{}: no answer was recorded", chain.name)});
    } else if (chain.deadline == 0) {
      all.push_back({Sentence::Tone::Plain, fmt::format("{}: the longest of {} answers took {}", chain.name,
                                                        format_count(figures.answers), describe(figures.longest))});
    } else {
      add_verdicts(chain, figures, all);
    }
    if (figures.unmatched > 0) {
      all.push_back({Sentence::Tone::Caution,
                     fmt::format("{}: {} more answers follow no job that can have caused them: the offsets, or the "
                                 "longest transport of a link, are wrong, or events were lost",
                                 chain.name, format_count(figures.unmatched))});
    }
  }
  return all;
}

bool has_misses(const ChainWatch &watch) {
  return std::any_of(watch.figures().begin(), watch.figures().end(),
                     [](const ChainFigures &figures) { return figures.count(Verdict::Missed) > 0; });
}

std::string to_json(const MergedRun &merged, const ChainWatch &watch) {
  Json hosts = Json::array();
  for (const Host &host : merged.hosts) hosts.push_back(to_json(host, merged.info.end));
  Json chains = Json::array();
  for (std::size_t c = 0; c < watch.chains().size(); ++c) {
    chains.push_back(to_json(watch.chains()[c], watch.figures()[c], merged));
  }
  Json words = Json::array();
  for (const Sentence &sentence : sentences_of(watch)) {
    words.push_back(Json{{"tone", to_string(sentence.tone)}, {"text", sentence.text}});
  }
  const Json document{{"format", kFormat},
                      {"provenance", Json::parse(provenance_to_json(merged.info.provenance))},
                      {"hosts", std::move(hosts)},
                      {"chains", std::move(chains)},
                      {"words", std::move(words)}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<std::optional<RecordedHosts>> read_hosts_of(const std::string &trace, const trace::RunInfo &run) {
  const std::string path = (std::filesystem::path(trace).parent_path() / kHostsFile).string();
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::nullopt;
  constexpr std::size_t kMostBytes = std::size_t{64} << 20U;
  const Result<std::string> text = trace::read_file(path, kMostBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  const auto bad = [&] { return trace::file_error(path, 1, "the file was not written by 'redag merge-traces'"); };
  if (json_nests_deeper(*text)) return bad();
  const Json json = Json::parse(*text, nullptr, false);
  if (!json.is_object() || json.value("format", Json()) != kFormat || !json.contains("provenance")) return bad();
  if (!Checker::is_document(json)) return bad();
  const Result<Provenance> provenance = provenance_from_json(json["provenance"].dump());
  if (!provenance) return bad();
  if (*provenance != run.provenance) return std::nullopt;
  RecordedHosts recorded{.document = json.dump()};
  for (const Json &chain : json["chains"]) {
    recorded.missed += chain["missed"].get<std::uint64_t>();
    recorded.unknown += chain["unknown"].get<std::uint64_t>();
  }
  return recorded;
}

}  // namespace redag::hosts
