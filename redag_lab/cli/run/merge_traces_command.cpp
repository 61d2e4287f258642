// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "redag/base/nearest.hpp"
#include "redag/base/text.hpp"
#include "redag/model/text_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_lab/cli/run/merge_report.hpp"
#include "redag_lab/cli/run/run_arguments.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/hosts/chains.hpp"
#include "redag_lab/hosts/document.hpp"
#include "redag_lab/hosts/hosts_yaml.hpp"
#include "redag_lab/hosts/merged_kernel.hpp"
#include "redag_lab/hosts/merged_run.hpp"
#include "redag_lab/hosts/time_service.hpp"
#include "redag_lab/robot/input.hpp"

namespace redag::cli {
namespace {

namespace fs = std::filesystem;

struct MergeTracesOptions {
  std::string file;
  std::vector<std::string> hosts;
  std::vector<std::string> offsets;
  std::vector<std::string> rates;
  std::vector<std::string> clocks;
  std::vector<std::string> uncertainties;
  std::vector<std::string> links;
  std::string robot;
  std::string folder;
  bool force = false;
  bool check = false;
  bool json = false;
};

Diagnostic mistake(std::string message, std::string hint = {}) {
  return Diagnostic{Severity::Error, {}, 0, 0, std::move(message), std::move(hint)};
}

// Collects the hosts and links of the file, the command line and the robot.
class Collector {
 public:
  explicit Collector(const MergeTracesOptions &options) : options_(options) {}

  Result<hosts::HostList> run() {
    if (!options_.file.empty()) read_file();
    for (const std::string &text : options_.hosts) {
      if (const auto [name, result] = parts(text, "--host"); !name.empty()) add(name, result);
    }
    for_each(options_.offsets, "--offset", [this](hosts::HostEntry &host, const std::string &text) {
      const Result<hosts::OffsetReading> reading = hosts::parse_offset(text);
      if (!reading) return keep(reading.error(), "--offset");
      host.clock.readings.push_back(*reading);
      host.clock.by += (host.clock.by.empty() ? "" : ", ") + text;
    });
    for_each(options_.rates, "--rate", [this](hosts::HostEntry &host, const std::string &text) {
      const Result<Duration> rate = hosts::parse_rate(text);
      if (!rate) return keep(rate.error(), "--rate");
      host.clock.rate = *rate;
    });
    for_each(options_.uncertainties, "--uncertainty", [this](hosts::HostEntry &host, const std::string &text) {
      const Result<Duration> extra = parse_duration(text);
      if (!extra) return keep(extra.error(), "--uncertainty");
      if (*extra < 0 || *extra > hosts::kMostOffset) {
        mistakes_.push_back(mistake(fmt::format("--uncertainty: {} is negative, or more than a day", in_quotes(text))));
      }
      host.clock.extra = std::max<Duration>(*extra, 0);
    });
    for_each(options_.clocks, "--clock",
             [](hosts::HostEntry &host, const std::string &path) { host.clock_files.push_back(path); });
    for (const std::string &text : options_.links) {
      const Result<hosts::Link> link = hosts::parse_link(text);
      link ? list_.links.push_back(*link) : keep(link.error(), "--link");
    }
    if (!options_.robot.empty()) read_robot();
    if (mistakes_.empty() && list_.hosts.size() < 2) {
      mistakes_.push_back(mistake(
          fmt::format("there {}, and merging takes at least two", list_.hosts.empty() ? "are no hosts" : "is one host"),
          "name each with --host NAME=RESULT"));
    }
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    return std::move(list_);
  }

 private:
  void keep(const Diagnostics &found, const std::string &option = {}) {
    for (Diagnostic each : found) {
      if (!option.empty()) each.message = option + ": " + each.message;
      mistakes_.push_back(std::move(each));
    }
  }

  // Splits "NAME=VALUE"; two empty texts after a mistake.
  std::pair<std::string, std::string> parts(const std::string &text, const std::string &option) {
    const std::size_t at = text.find('=');
    if (at != std::string::npos && at > 0 && at + 1 < text.size()) return {text.substr(0, at), text.substr(at + 1)};
    mistakes_.push_back(mistake(fmt::format("{}: {} does not name a host", option, in_quotes(text)),
                                fmt::format("write {} HOST=VALUE", option)));
    return {};
  }

  void read_file() {
    const Result<std::string> text = read_text_file(options_.file, "a file of hosts", hosts::kMostHostsBytes);
    if (!text) return keep(text.error());
    if (text->size() > hosts::kMostHostsBytes) {
      return keep(trace::file_error(options_.file, 0, "the file is too long for a file of hosts").value());
    }
    Result<hosts::HostList> list = hosts::parse_hosts(*text, options_.file);
    if (!list) return keep(list.error());
    list_.links = std::move(list->links);
    for (hosts::HostEntry &host : list->hosts) add_entry(std::move(host));
  }

  void add(const std::string &name, const std::string &result) {
    if (const std::string why = hosts::host_name_mistake(name); !why.empty()) {
      mistakes_.push_back(mistake(fmt::format("--host: the name {} of a host {}", in_quotes(name), why)));
      return;
    }
    hosts::HostEntry host;
    host.name = name;
    host.result = result;
    add_entry(std::move(host));
  }

  void add_entry(hosts::HostEntry host) {
    const auto same = [&](const hosts::HostEntry &other) { return other.name == host.name; };
    if (std::any_of(list_.hosts.begin(), list_.hosts.end(), same)) {
      mistakes_.push_back(Diagnostic{Severity::Error, host.file, host.line, host.column,
                                     fmt::format("two hosts are called '{}'", host.name),
                                     "give each host a name of its own"});
      return;
    }
    list_.hosts.push_back(std::move(host));
  }

  template <class Take>
  void for_each(const std::vector<std::string> &texts, const std::string &option, Take take) {
    for (const std::string &text : texts) {
      const auto [name, value] = parts(text, option);
      if (name.empty()) continue;
      const auto host = std::find_if(list_.hosts.begin(), list_.hosts.end(),
                                     [&, &wanted = name](const auto &each) { return each.name == wanted; });
      if (host != list_.hosts.end()) {
        take(*host, value);
        continue;
      }
      std::vector<std::string> names;
      for (const hosts::HostEntry &each : list_.hosts) names.push_back(each.name);
      mistakes_.push_back(mistake(fmt::format("{}: there is no host {}", option, in_quotes(name)),
                                  names.empty() ? "name it with --host NAME=RESULT" : suggestion(name, names)));
    }
  }

  // Links between processes that are no hosts here stay within a host, or lead to one that was not recorded.
  void read_robot() {
    const Result<robot::Input> input = robot::load_input(options_.robot, {.wcet_optional = true});
    if (!input) return keep(input.error());
    if (!input->robot) {
      return keep({Diagnostic{Severity::Error, options_.robot, 1, 1, "--robot: the file is no robot file",
                              "a robot file has the key 'robot:' (docs/robot.md)"}});
    }
    const auto is_host = [&](std::size_t process) {
      return std::any_of(list_.hosts.begin(), list_.hosts.end(), [&](const hosts::HostEntry &host) {
        return host.name == input->robot->processes[process].name;
      });
    };
    bool any = false;
    for (const robot::Link &link : input->robot->links) {
      if (!is_host(link.from.process) || !is_host(link.to.process)) continue;
      any = true;
      list_.links.push_back(
          {link.from.name, link.to.name, link.transport, link.place.file, link.place.line, link.place.column});
    }
    if (any) return;
    mistakes_.push_back(Diagnostic{Severity::Error, options_.robot, 0, 0,
                                   "--robot: no link of the robot joins two of the hosts",
                                   "give hosts the names of the robot's processes"});
  }

  const MergeTracesOptions &options_;
  hosts::HostList list_;
  Diagnostics mistakes_;
};

// Opens the results, and reads the texts of time services.
Result<std::vector<hosts::HostRun>> open(hosts::HostList &list) {
  std::vector<hosts::HostRun> runs;
  Diagnostics mistakes;
  const auto keep = [&](const Diagnostics &found) { mistakes.insert(mistakes.end(), found.begin(), found.end()); };
  std::set<fs::path> seen;
  for (hosts::HostEntry &host : list.hosts) {
    for (const std::string &path : host.clock_files) {
      const Result<std::string> text = read_text_file(path, "the text of a time service", hosts::kMostTimeServiceBytes);
      if (!text) {
        keep(text.error());
        continue;
      }
      const Result<hosts::TimeServiceReading> reading = hosts::parse_time_service(*text, path);
      reading ? hosts::add_reading(*reading, path, host.clock) : keep(reading.error());
    }
    const Result<std::string> trace = find_trace(host.result);
    if (!trace) {
      keep(trace.error());
      continue;
    }
    if (!seen.insert(fs::absolute(*trace).lexically_normal()).second) {
      keep({Diagnostic{Severity::Error, host.file, host.line, host.column,
                       fmt::format("host '{}' has the result of another host: {}", host.name, *trace),
                       "name the result that was recorded on this host"}});
      continue;
    }
    Result<trace::EventsReader> reader = trace::EventsReader::open(*trace);
    if (!reader) {
      keep(reader.error());
      continue;
    }
    runs.push_back({host.name, *trace, *std::move(reader), host.clock, host.file, host.line, host.column});
  }
  if (!mistakes.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes));
  return runs;
}

// Reads the merged run once: into the files, the summary, the trace checker and the chains.
Result<lab::Session> evaluate(const hosts::MergedRun &merged, std::vector<hosts::HostRun> &runs,
                              hosts::ChainWatch &watch, const std::string &folder) {
  lab::Session session;
  session.info = merged.info;
  Result<metrics::RunFiles> files = metrics::RunFiles::create({.folder = folder}, merged.info);
  if (!files) return tl::unexpected<Diagnostics>(std::move(files.error()));
  session.files = std::make_unique<metrics::RunFiles>(*std::move(files));
  metrics::Summarizer summarizer(merged.info);
  metrics::TraceChecker checker(merged.info, metrics::rules_for(merged.info));
  const Result<void> read =
      hosts::visit_merged(merged, runs, InterruptGuard::interrupted, [&](std::span<const JobEvent> events) {
        session.events += events.size();
        session.files->add(events);
        summarizer.add(events);
        if (merged.info.lost_events == 0) checker.add(events);
        watch.add(events);
      });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  watch.finish();
  session.summary = summarizer.finish(merged.info.end);
  session.check = checker.finish(merged.info.end, merged.info.lost_events);
  session.checked = session.events;
  return session;
}

// Begins the merged record of the hosts' kernels. Nothing if no host has one.
Result<std::optional<metrics::KernelWriter>> merge_kernels(const hosts::MergedRun &merged, const std::string &folder) {
  const Result<std::vector<hosts::HostKernel>> kernels = hosts::open_kernel_records(merged);
  if (!kernels) return tl::unexpected<Diagnostics>(kernels.error());
  if (kernels->empty()) return std::optional<metrics::KernelWriter>();
  Result<metrics::KernelWriter> writer =
      metrics::KernelWriter::create(fmt::format("{}/{}", folder, metrics::kKernelFile), merged.info.provenance);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  const Result<void> written = hosts::merge_kernel_records(merged, *kernels, InterruptGuard::interrupted, *writer);
  if (!written) return tl::unexpected<Diagnostics>(written.error());
  return std::optional<metrics::KernelWriter>(*std::move(writer));
}

int merge(const MergeTracesOptions &options, Console &console) {
  const auto refuse = [&console](const Diagnostics &mistakes) {
    console.note(mistakes);
    return kExitBad;
  };
  Result<hosts::HostList> list = Collector(options).run();
  if (!list) return refuse(list.error());
  Result<std::vector<hosts::HostRun>> runs = open(*list);
  if (!runs) return refuse(runs.error());
  const Result<hosts::MergedRun> merged = hosts::merge(*runs);
  if (!merged) return refuse(merged.error());
  Result<std::vector<hosts::Chain>> chains = hosts::find_chains(*merged, list->links);
  if (!chains) return refuse(chains.error());
  if (const Result<void> made = prepare_folder(options.folder, options.force); !made) return refuse(made.error());
  const InterruptGuard guard;
  hosts::ChainWatch watch(*merged, *std::move(chains));
  Result<lab::Session> session = evaluate(*merged, *runs, watch, options.folder);
  if (!session) return refuse(session.error());
  Result<std::optional<metrics::KernelWriter>> kernel = merge_kernels(*merged, options.folder);
  if (!kernel) return refuse(kernel.error());
  session->kernel = *std::move(kernel);
  const std::string document = hosts::to_json(*merged, watch);
  if (options.json) {
    console.print(document);
  } else {
    console.say(describe(*session, *merged, watch, console.out_traits()));
  }
  WrittenFiles written = write_session(*session, {.folder = options.folder});
  if (Result<void> result = write_text(options.folder + "/" + hosts::kHostsFile, document); !result) {
    written.problems.insert(written.problems.end(), result.error().begin(), result.error().end());
  }
  console.note(written.problems);
  if (!written.problems.empty()) return kExitBad;
  const std::string message = fmt::format("merged {} events into {}/: {}, {}\n{}", format_count(session->events),
                                          options.folder, written.names, hosts::kHostsFile, written.no_picture);
  options.json ? console.note(message) : console.say(message);
  return options.check && hosts::has_misses(watch) ? kExitNo : kExitOk;
}

}  // namespace

Action add_merge_traces(CLI::App &app) {
  auto options = std::make_shared<MergeTracesOptions>();
  const auto texts = [&app](const std::string &name, std::vector<std::string> &target, const char *type,
                            const std::string &help) {
    app.add_option(name, target, help)->type_name(type)->allow_extra_args(false);
  };
  app.add_option("FILE", options->file, "File that lists the hosts, instead of --host or beside it")->type_name("FILE");
  texts("--host", options->hosts, "NAME=RESULT", "Name of a host, and the folder of the run recorded there; repeat");
  texts(
      "--offset", options->offsets, "HOST=TIME",
      "Clock of the host minus the common clock, such as 1.25ms+-80us, or 0 for the common clock itself; with @start, "
      "@end or @TIME, when it was read");
  texts("--rate", options->rates, "HOST=PPM", "Most by which the offset changes, such as 10ppm");
  texts("--clock", options->clocks, "HOST=FILE",
        "Output of 'chronyc tracking' or 'pmc' on the host; repeat for one before and one after the run");
  texts("--uncertainty", options->uncertainties, "HOST=TIME", "Added to the uncertainty of the host's clock");
  texts("--link", options->links, "FROM,TO,TIME",
        "Data between hosts: HOST.DAG.TASK twice, and the longest transport; repeat");
  app.add_option("--robot", options->robot, "Robot file whose links join hosts that have the names of its processes")
      ->type_name("FILE");
  app.add_option("--out", options->folder, "Folder for the merged result; created if missing")
      ->type_name("DIR")
      ->required();
  app.add_flag("--force", options->force, "Write into a folder that holds other files");
  app.add_flag("--check", options->check, "Exit with status 1 if a chain over hosts certainly missed its deadline");
  app.add_flag("--json", options->json, "Write the hosts and chains as one JSON document to standard output");
  return [options](Console &console) { return merge(*options, console); };
}

}  // namespace redag::cli
