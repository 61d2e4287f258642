// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>
#include <httplib.h>
#include <sys/socket.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag/live/writer.hpp"
#include "redag/threads/clock.hpp"
#include "redag_lab/cli/serve/access.hpp"
#include "redag_lab/cli/serve/live_feed.hpp"
#include "redag_lab/cli/serve/metrics.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/report/page_assets.hpp"

namespace redag::cli {
namespace {

constexpr std::uint32_t kPort = 8642;
constexpr const char *kAddress = "127.0.0.1";
constexpr unsigned kWatchers = 8;             // at a time
constexpr unsigned kThreads = kWatchers + 8;  // each watcher has one
constexpr int kTimeout = 5;                   // s that a client may let the server wait

struct ServeArguments {
  std::uint32_t port = kPort;
  Duration interval = kSecond;
  std::string folder = live::kFolder;
  std::string token_file;
};

// A page of this server loads what this server serves, and nothing else. Bars have their length in an attribute.
constexpr const char *kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; connect-src 'self'; "
    "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

struct Asset {
  const char *path;
  const char *type;
  std::string_view content;
};

std::vector<Asset> assets() {
  namespace files = report::assets;
  return {{"/", "text/html; charset=utf-8", files::kLiveTemplate},
          {"/style.css", "text/css; charset=utf-8", files::kLiveStyle},
          {"/live.js", "text/javascript; charset=utf-8", files::kLiveScript}};
}

Credentials credentials_of(const httplib::Request &request) {
  return {.method = request.method,
          .path = request.path,
          .hosts = request.get_header_value_count("Host"),
          .host = request.get_header_value("Host"),
          .token = request.get_param_value("token"),
          .cookie = request.get_header_value("Cookie"),
          .authorization = request.get_header_value("Authorization")};
}

void refuse(httplib::Response &response, int status, const char *why) {
  response.status = status;
  response.set_content(std::string(why) + "\n", "text/plain; charset=utf-8");
}

/// The HTTP server: the page, its files, the stream of states, and metrics. It listens on the loopback device, changes
/// nothing, and answers only who knows the token.
class Server {
 public:
  Server(const ServeArguments &options, std::string token)
      : token_(std::move(token)), folder_(options.folder), feed_(options.folder, options.interval, kWatchers) {
    server_.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
    server_.set_payload_max_length(1024);
    server_.set_read_timeout(kTimeout);
    server_.set_write_timeout(kTimeout);
    server_.set_keep_alive_timeout(2);
    server_.set_tcp_nodelay(true);
    // The library's own choice, SO_REUSEPORT, would share the port with another server.
    server_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      (void)::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    server_.set_default_headers({{"Content-Security-Policy", kPolicy},
                                 {"X-Content-Type-Options", "nosniff"},
                                 {"X-Frame-Options", "DENY"},
                                 {"Referrer-Policy", "no-referrer"},
                                 {"Cross-Origin-Opener-Policy", "same-origin"},
                                 {"Cross-Origin-Resource-Policy", "same-origin"},
                                 {"Cache-Control", "no-store"}});
  }

  ~Server() {
    feed_.stop();
    if (thread_.joinable()) {
      server_.stop();
      thread_.join();
    }
  }
  Server(const Server &) = delete;
  Server &operator=(const Server &) = delete;

  /// Error: the port cannot be had.
  [[nodiscard]] Result<void> listen(int port) {
    port_ = port == 0 ? server_.bind_to_any_port(kAddress) : server_.bind_to_port(kAddress, port) ? port : -1;
    if (port_ < 0) {
      return make_error(fmt::format("port {} of {} cannot be had: it is in use, or not permitted", port, kAddress),
                        "choose another one with --port, or --port 0 for a free one");
    }
    route(Gate(token_, port_));
    thread_ = std::thread([this] { (void)server_.listen_after_bind(); });
    while (!server_.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return {};
  }

  /// Returns the address that opens the page.
  [[nodiscard]] std::string address() const { return fmt::format("http://{}:{}/?token={}", kAddress, port_, token_); }
  /// Returns false once the server has stopped by itself, because the system takes its socket away.
  [[nodiscard]] bool is_running() const { return server_.is_running(); }

 private:
  void route(const Gate &gate) {
    server_.set_pre_routing_handler([gate](const httplib::Request &request, httplib::Response &response) {
      using Handled = httplib::Server::HandlerResponse;
      switch (gate.judge(credentials_of(request))) {
        case Access::Granted: return Handled::Unhandled;
        case Access::Introduced:
          response.set_header("Set-Cookie", gate.cookie());
          response.set_redirect("/", 303);
          break;
        case Access::WrongHost: refuse(response, 421, "this server answers to 127.0.0.1 and localhost only"); break;
        case Access::WrongMethod: refuse(response, 405, "this server only shows"); break;
        case Access::Denied: refuse(response, 403, "open the address that redag serve has printed"); break;
      }
      return Handled::Handled;
    });
    for (const Asset &asset : assets()) {
      server_.Get(asset.path, [asset](const httplib::Request &, httplib::Response &response) {
        response.set_content(asset.content.data(), asset.content.size(), asset.type);
      });
    }
    server_.Get("/metrics", [this](const httplib::Request &, httplib::Response &response) {
      const std::vector<live::Listed> pages = live::list_pages(folder_);
      response.set_content(metrics_text(pages, runtime::monotonic_now()), "text/plain; version=0.0.4; charset=utf-8");
    });
    server_.Get("/events",
                [this](const httplib::Request &request, httplib::Response &response) { stream(request, response); });
  }

  void stream(const httplib::Request &request, httplib::Response &response) {
    std::optional<LiveTarget> target;
    if (request.has_param("executor")) {
      target = parse_target(request.get_param_value("executor"));
      if (!target) return refuse(response, 400, "'executor' is PID or PID.N");
    }
    std::shared_ptr<LiveFeed::Watcher> watcher = feed_.watch(target);
    if (watcher == nullptr) return refuse(response, 503, "too many windows watch already");
    response.set_chunked_content_provider("text/event-stream",
                                          [watcher = std::move(watcher)](std::size_t, httplib::DataSink &sink) {
                                            const std::optional<std::string> document = watcher->next();
                                            if (!document) {
                                              sink.done();
                                              return true;
                                            }
                                            const std::string event = "data: " + *document + "\n\n";
                                            return sink.write(event.data(), event.size());
                                          });
  }

  const std::string token_;
  const std::string folder_;
  int port_ = -1;
  LiveFeed feed_;  // the server's threads use it
  httplib::Server server_;
  std::thread thread_;
};

int serve(const ServeArguments &options, Console &console) {
  const InterruptGuard guard;
  const Result<std::string> token = options.token_file.empty() ? make_token() : read_token(options.token_file);
  if (!ok(token, console)) return kExitBad;
  Server server(options, *token);
  if (!ok(server.listen(static_cast<int>(options.port)), console)) return kExitBad;
  console.print(server.address() + "\n");
  if (!console.flush()) return kExitBad;
  console.note("open this address in a browser of this machine; Ctrl-C ends\n");
  while (!InterruptGuard::interrupted()) {
    if (!server.is_running()) {
      console.error("the server has lost its socket");
      return kExitBad;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return kExitOk;
}

}  // namespace

Action add_serve(CLI::App &app) {
  auto options = std::make_shared<ServeArguments>();
  add_count(app, "--port", options->port, Range<std::uint32_t>{0, 65535}, "Port on 127.0.0.1; 0: a free one");
  add_duration(app, "--interval", options->interval, "Time between two updates");
  add_pages_folder(app, options->folder);
  app.add_option("--token-file", options->token_file, "File with the token, instead of a new one at each start")
      ->type_name("FILE");
  return [options](Console &console) { return serve(*options, console); };
}

}  // namespace redag::cli
