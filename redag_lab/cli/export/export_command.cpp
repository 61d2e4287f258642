// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>
#include <string>

#include "redag/live/writer.hpp"
#include "redag_lab/cli/export/prometheus_exporter.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

struct ExportOptions {
  bool prometheus = false;
  std::string endpoint = Endpoint().text();
  bool once = false;
  std::string folder = live::kFolder;
};

int print_once(const ExportOptions &options, Console &console) {
  const Result<std::string> text = prometheus_text(options.folder);
  if (!text) {
    console.note(text.error());
    return kExitBad;
  }
  console.print(*text);
  return kExitOk;
}

int serve(const ExportOptions &options, Console &console) {
  const Result<Endpoint> endpoint = parse_endpoint(options.endpoint);
  if (!endpoint) {
    console.note(endpoint.error());
    return kExitBad;
  }
  if (!endpoint->is_loopback()) {
    console.warn(fmt::format("whoever reaches {} can read the names and figures of all executors", endpoint->host));
  }
  const InterruptGuard guard;
  const Result<void> served =
      serve_prometheus(options.folder, *endpoint, InterruptGuard::flag(), [&](const Endpoint &actual) {
        console.note(fmt::format("Prometheus can scrape http://{}/metrics; Ctrl-C ends\n", actual.text()));
      });
  if (!served) {
    console.note(served.error());
    return kExitBad;
  }
  return kExitOk;
}

}  // namespace

Action add_export(CLI::App &app) {
  auto options = std::make_shared<ExportOptions>();
  CLI::Option *prometheus =
      app.add_flag("--prometheus", options->prometheus, "Serve the figures of all running executors to Prometheus");
  CLI::Option *listen = app.add_option("--listen", options->endpoint, "Address and port where Prometheus scrapes")
                            ->type_name("HOST:PORT")
                            ->capture_default_str()
                            ->needs(prometheus);
  app.add_flag("--once", options->once, "Print the figures once in Prometheus's text format, and exit")
      ->needs(prometheus)
      ->excludes(listen);
  add_pages_folder(app, options->folder)->needs(prometheus);
  return [options](Console &console) {
    if (!options->prometheus) {
      console.error("nothing to export to is named", "add --prometheus");
      return kExitBad;
    }
    return options->once ? print_once(*options, console) : serve(*options, console);
  };
}

}  // namespace redag::cli
