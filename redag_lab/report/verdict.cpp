// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::report {
namespace {

// Without a miss: how close it was.
std::string closest(const Group &group) {
  if (group.why.worst.empty()) return {};
  const metrics::JobRecord &job = group.why.worst.front().job;
  return fmt::format(" The closest to its deadline was {}, with {} to spare.",
                     trace::task_name(group.workload(), job.task), humanize_duration(-job.lateness()));
}

Tone tone_of(const metrics::DeadlineVerdict &verdict) {
  if (!verdict.is_judged) return Tone::Caution;
  return verdict.is_met ? Tone::Good : Tone::Bad;
}

metrics::DeadlineVerdict deadlines_of(const Group &group) { return metrics::deadline_verdict(group.total, group.dags); }

Sentence on_deadlines(const Group &group) {
  const metrics::DeadlineVerdict verdict = deadlines_of(group);
  return {tone_of(verdict), verdict.is_met ? verdict.text + closest(group) : verdict.text};
}

Sentence on_bounds(const Group &group) {
  const RunBounds &bounds = group.bounds;
  if (!bounds.absent.empty()) return {Tone::Plain, fmt::format("No bounds to compare with: {}.", bounds.absent)};
  std::vector<std::string> above;
  std::size_t bounded = 0;
  bool is_within = true;
  for (std::size_t t = 0; t < bounds.tasks.size(); ++t) {
    if (!bounds.tasks[t].response) continue;
    ++bounded;
    const Duration longest = group.tasks[t].response.max;
    if (longest <= *bounds.tasks[t].response) continue;
    is_within = false;
    if (!group.is_simulated()) continue;  // reported with the assumption that broke
    above.push_back(fmt::format("{} ({}, bound {})", trace::task_name(group.workload(), TaskId(t)),
                                humanize_duration(longest), humanize_duration(*bounds.tasks[t].response)));
  }
  for (std::size_t d = 0; d < bounds.dags.size(); ++d) {
    const Duration longest = group.dags[d].end_to_end.response.max;
    if (!bounds.dags[d].response || longest <= *bounds.dags[d].response) continue;
    is_within = false;
    if (!is_above_bound(group, DagId(d))) continue;
    above.push_back(fmt::format("DAG {} ({}, bound {})", group.workload().dags[d].name, humanize_duration(longest),
                                humanize_duration(*bounds.dags[d].response)));
  }
  if (!above.empty()) {
    return {Tone::Bad,
            fmt::format("Above the bound: {}. {}", join_first(above, 3),
                        group.is_simulated()
                            ? "A bound was exceeded in virtual time: either the bound or the simulation is wrong."
                            : "An assumption of the bound does not hold.")};
  }
  const std::string within = bounded == 0 || !is_within
                                 ? ""
                                 : fmt::format(" Every response time was within its bound ({} of {} have one).",
                                               bounded, plural(bounds.tasks.size(), "task"));
  if (bounds.schedulable && metrics::has_misses(group.total, group.dags)) {
    return {Tone::Caution, fmt::format("Analysis ({}): every deadline is met, by {}, if its assumptions hold. This run "
                                       "missed deadlines, so they did not hold.{}",
                                       bounds.assumes, join_first(bounds.by, 2), within)};
  }
  if (bounds.schedulable) {
    return {Tone::Good, fmt::format("Analysis ({}): every deadline is met, by {}.{}", bounds.assumes,
                                    join_first(bounds.by, 2), within)};
  }
  return {Tone::Plain,
          fmt::format("Analysis ({}): not every deadline is shown to be met; bounds are safe, not exact.{}",
                      bounds.assumes, within)};
}

// Adds the first ones as sentences, and says how many more there are.
void add_bad(const std::vector<std::string> &texts, std::vector<Sentence> &sentences) {
  constexpr std::size_t kMost = 5;
  for (std::size_t i = 0; i < std::min(kMost, texts.size()); ++i) sentences.push_back({Tone::Bad, texts[i]});
  if (texts.size() > kMost)
    sentences.push_back({Tone::Bad, fmt::format("{} more of this kind.", texts.size() - kMost)});
}

// Adds each alarm as a sentence, and one sentence for all deviations that the machine's noise may explain.
void add_assumptions(const Group &group, std::vector<Sentence> &sentences) {
  std::vector<std::string> alarms;
  std::vector<std::string> notes;
  for (metrics::Remark &remark : metrics::remarks(group.assumptions, group.workload())) {
    if (remark.is_alarm) {
      alarms.push_back(remark.text + ".");
    } else {
      notes.push_back(std::move(remark.text));
    }
  }
  add_bad(alarms, sentences);
  if (!notes.empty()) {
    sentences.push_back({Tone::Plain, fmt::format("No alarm; the machine's noise may explain these deviations: {}.",
                                                  join_first(notes, 3))});
  }
}

// What observers noticed during the runs.
void add_noticed(const Group &group, std::vector<Sentence> &sentences) {
  std::vector<std::string> noticed;
  for (const RunDigest &run : group.runs) {
    for (const trace::Remark &remark : run.info.remarks) {
      noticed.push_back(fmt::format(
          "Noticed {} after the start, {}: {}", humanize_duration(remark.begun - run.info.start),
          remark.ended == kNever ? "until the end" : "for " + humanize_duration(remark.ended - remark.begun),
          remark.text));
    }
  }
  add_bad(noticed, sentences);
}

void add_remarks(const Group &group, std::vector<Sentence> &sentences) {
  if (!group.is_simulated()) add_assumptions(group, sentences);
  std::uint64_t violations = 0;
  std::uint64_t checks = 0;
  std::uint64_t lost = 0;
  bool enforced = true;
  std::string first;
  for (const RunDigest &run : group.runs) {
    violations += run.check.violation_count;
    for (const std::uint64_t count : run.check.checks_by_rule) checks += count;
    if (first.empty() && !run.check.violations.empty()) first = run.check.violations.front().to_string();
    lost += run.info.lost_events;
    enforced = enforced && run.summary.all_enforced;
  }
  if (violations > 0) {
    sentences.push_back(
        {Tone::Bad, fmt::format("The trace violates rules of the model {}: {}", plural(violations, "time"), first)});
  } else {
    sentences.push_back(
        {Tone::Good, fmt::format("The trace checker found no violation of the model in {}.", plural(checks, "check"))});
  }
  add_noticed(group, sentences);
  if (!enforced) sentences.push_back({Tone::Bad, "A bound on jobs in progress or an exclusive group was violated."});
  if (lost > 0) {
    sentences.push_back({Tone::Caution, fmt::format("{} lost: the figures are incomplete.", plural(lost, "event"))});
  }
}

}  // namespace

const char *to_string(Tone tone) {
  switch (tone) {
    case Tone::Good: return "good";
    case Tone::Bad: return "bad";
    case Tone::Caution: return "caution";
    case Tone::Plain: return "plain";
  }
  REDAG_CHECK(false, "an unknown tone");
  return "";
}

bool is_above_bound(const Group &group, DagId dag) {
  const std::vector<BoundOf> &bounds = group.bounds.dags;
  if (dag.value >= bounds.size() || !bounds[dag.value].response) return false;
  const Duration longest = group.dags[dag.value].end_to_end.response.max;
  return longest > *bounds[dag.value].response + (group.is_simulated() ? 0 : group.assumptions.unalarming(longest));
}

std::vector<Sentence> verdict_of(const Group &group) {
  std::vector<Sentence> sentences = {on_deadlines(group), on_bounds(group)};
  add_remarks(group, sentences);
  return sentences;
}

Spread spread_of(std::vector<double> values) {
  REDAG_CHECK(!values.empty(), "a spread of nothing");
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  const double median = values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
  return {median, values.front(), values.back()};
}

std::string ranking(std::span<const Contender> contenders) {
  REDAG_CHECK(!contenders.empty(), "a ranking needs contenders");
  const auto best = std::min_element(contenders.begin(), contenders.end(), [](const Contender &a, const Contender &b) {
    return a.misses.median < b.misses.median;
  });
  const Spread least = best->misses;
  std::vector<std::string> alike = {best->name};
  std::vector<std::string> worse;
  bool none = best->missed == 0;  // of the contenders that are alike
  for (const Contender &contender : contenders) {
    if (&contender == &*best) continue;
    // Ranges that touch do not predict the next repetition.
    const bool is_worse = contender.misses.min > least.max;
    (is_worse ? worse : alike).push_back(contender.name);
    if (!is_worse) none = none && contender.missed == 0;
  }
  if (worse.empty()) return "no clear difference";
  const std::string rest = join(worse) + (worse.size() == 1 ? " misses more" : " miss more");
  if (alike.size() == 1) return alike.front() + " misses fewest";
  if (none) return fmt::format("{} miss none, {}", join(alike), rest);
  return fmt::format("{} do not differ clearly, {}", join(alike), rest);
}

std::string comparison_line(const std::string &dag, std::span<const Contender> contenders) {
  std::string line = dag + ": ";
  bool any = false;
  for (const Contender &contender : contenders) {
    any = any || contender.missed > 0;
    const bool first = &contender == &contenders.front();
    line += fmt::format("{}{} {}{}", first ? "" : ", ", contender.name, first ? "misses " : "",
                        format_share(contender.missed, contender.released));
  }
  return line + ": " + (any ? ranking(contenders) : "no deadline missed");
}

std::vector<CommonDag> common_dags(std::span<const Group> groups) {
  std::vector<CommonDag> common;
  if (groups.size() < 2) return common;
  for (const Dag &dag : groups.front().workload().dags) {
    CommonDag row{dag.name, {}};
    for (const Group &group : groups) {
      const std::vector<Dag> &dags = group.workload().dags;
      const auto same = std::find_if(dags.begin(), dags.end(), [&](const Dag &d) { return d.name == dag.name; });
      if (same != dags.end()) row.ids.emplace_back(static_cast<std::size_t>(same - dags.begin()));
    }
    if (row.ids.size() == groups.size()) common.push_back(std::move(row));
  }
  return common;
}

Spread misses_of(const Group &group, std::optional<DagId> dag) {
  std::vector<double> misses;
  for (const RunDigest &run : group.runs) {
    misses.push_back((dag ? run.summary.dags[dag->value].jobs : run.summary.total).miss_ratio_with_lost());
  }
  return spread_of(std::move(misses));
}

Sentence headline_of(std::span<const Group> groups) {
  REDAG_CHECK(!groups.empty(), "a headline of nothing");
  if (groups.size() == 1) {
    const metrics::DeadlineVerdict verdict = deadlines_of(groups.front());
    return {tone_of(verdict), verdict.headline};
  }
  std::vector<Contender> contenders;
  std::vector<std::string> shares;
  for (const Group &group : groups) {
    const metrics::JobCounts &total = group.total;
    contenders.push_back({.name = group.label,
                          .missed = total.missed(),
                          .released = total.released,
                          .misses = misses_of(group, std::nullopt)});
    const std::string share = total.missed() == 0 ? "none" : format_percent(total.miss_ratio_with_lost());
    shares.push_back(shares.empty() ? fmt::format("{} missed {} of its deadlines", group.label, share)
                                    : fmt::format("{} {}", group.label, share));
  }
  const auto missed = [](const Contender &contender) { return contender.missed > 0; };
  if (std::none_of(contenders.begin(), contenders.end(), missed)) {
    return {Tone::Good, "No job missed its deadline under any executor"};
  }
  const std::string order = ranking(contenders);
  const bool is_plain = order.ends_with(" misses fewest");  // the shares say so
  return {Tone::Plain, join(shares) + (is_plain ? "" : ": " + order)};
}

}  // namespace redag::report
