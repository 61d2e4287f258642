// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/merge_report.hpp"

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag_analysis/metrics/verdict.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/hosts/document.hpp"

namespace redag::cli {
namespace {

std::string shown(const hosts::Interval &offset) {
  return fmt::format("{} \u00b1 {}", humanize_duration(offset.middle()), humanize_duration(offset.radius()));
}

std::string table_of_hosts(const hosts::MergedRun &merged, const StreamTraits &terminal) {
  Table table({{.title = "host", .importance = 9},
               {.title = "offset at start", .number = true, .importance = 7},
               {.title = "at end", .number = true, .importance = 6},
               {.title = "times within", .number = true, .importance = 8},
               {.title = "by", .importance = 5}});
  for (const hosts::Host &host : merged.hosts) {
    table.add({{host.name},
               {shown(host.clock.at(host.info.start))},
               {shown(host.clock.at(host.info.end))},
               {humanize_duration(host.clock.within())},
               {host.clock_by}});
  }
  return table.render(terminal.width, terminal.colour);
}

std::string table_of_chains(const hosts::ChainWatch &watch, const StreamTraits &terminal) {
  Table table({{.title = "chain", .importance = 9, .prose = true},
               {.title = "deadline", .number = true, .importance = 7},
               {.title = "answers", .number = true, .importance = 5},
               {.title = "met", .number = true, .importance = 6},
               {.title = "missed", .number = true, .importance = 8},
               {.title = "cannot tell", .number = true, .importance = 8},
               {.title = "longest", .number = true, .importance = 7},
               {.title = "shortest", .number = true, .importance = 4}});
  for (std::size_t c = 0; c < watch.chains().size(); ++c) {
    const hosts::Chain &chain = watch.chains()[c];
    const hosts::ChainFigures &figures = watch.figures()[c];
    const auto number_of = [&](hosts::Verdict verdict, Tint tint) {
      const std::uint64_t count = figures.count(verdict);
      return chain.deadline == 0 ? Cell{"-"} : Cell{format_count(count), count > 0 ? tint : Tint::Plain};
    };
    const auto range = [&](const hosts::Interval &latency) {
      return figures.answers > 0 ? Cell{shown(latency)} : Cell{"-"};
    };
    table.add({{chain.name},
               {chain.deadline > 0 ? format_duration(chain.deadline) : "-"},
               {format_count(figures.answers)},
               number_of(hosts::Verdict::Met, Tint::Plain),
               number_of(hosts::Verdict::Missed, Tint::Bad),
               number_of(hosts::Verdict::Unknown, Tint::Caution),
               range(figures.longest),
               range(figures.shortest)});
  }
  return table.render(terminal.width, terminal.colour);
}

}  // namespace

std::string describe(const lab::Session &session, const hosts::MergedRun &merged, const hosts::ChainWatch &watch,
                     const StreamTraits &terminal) {
  std::string text =
      fmt::format("{}: {} hosts, {} from the first start to the first end\n\n", session.info.workload.name,
                  merged.hosts.size(), humanize_duration(session.info.end - session.info.start));
  text += table_of_hosts(merged, terminal);
  if (!watch.chains().empty()) text += "\n" + table_of_chains(watch, terminal);
  for (const hosts::Sentence &sentence : hosts::sentences_of(watch)) text += sentence.text + "\n";
  const metrics::DeadlineVerdict verdict = metrics::deadline_verdict(session.summary.total, session.summary.dags);
  return text + "on each host: " + verdict.text + "\n" + describe_check(session.check, terminal);
}

}  // namespace redag::cli
