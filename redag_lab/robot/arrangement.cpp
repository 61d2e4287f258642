// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/arrangement.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "redag/base/cpu_list.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::robot {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kFormat = "redag.arrangement/1";
constexpr std::size_t kMostBytes = std::size_t{64} << 20U;

Json to_json(const std::vector<int> &cpus) { return format_cpu_list(cpus); }

Json to_json(const ThreadState &state) {
  return Json{{"class", static_cast<int>(state.scheduling.kind)},
              {"priority", state.scheduling.priority},
              {"nice", state.scheduling.nice},
              {"resets_on_fork", state.scheduling.resets_on_fork},
              {"reservation", {state.scheduling.budget, state.scheduling.deadline, state.scheduling.period}},
              {"cpus", to_json(state.cpus)}};
}

std::vector<int> cpus_in(const Json &json) {
  std::optional<std::vector<int>> cpus = parse_cpu_list(json.get<std::string>());
  if (!cpus || cpus->empty()) throw std::invalid_argument("processors");
  return *std::move(cpus);
}

int number_in(const Json &json, const char *key, int least, int most) {
  const auto value = json.at(key).get<std::int64_t>();
  if (value < least || value > most) throw std::invalid_argument(key);
  return static_cast<int>(value);
}

ThreadState state_in(const Json &json) {
  Scheduling scheduling;
  scheduling.kind =
      static_cast<Scheduling::Class>(number_in(json, "class", 0, static_cast<int>(Scheduling::Class::Deadline)));
  scheduling.priority = number_in(json, "priority", 0, 99);
  scheduling.nice = number_in(json, "nice", -20, 19);
  scheduling.resets_on_fork = json.at("resets_on_fork").get<bool>();
  // States of earlier versions have no reservations.
  if (const auto found = json.find("reservation"); found != json.end()) {
    std::tie(scheduling.budget, scheduling.deadline, scheduling.period) =
        found->get<std::tuple<Duration, Duration, Duration>>();
  }
  return ThreadState{scheduling, cpus_in(json.at("cpus"))};
}

Json to_json(const ThreadChange &change) {
  return Json{{"pid", change.thread.pid},
              {"tid", change.thread.tid},
              {"start", change.thread.start},
              {"name", printable(change.name)},
              {"program", printable(change.program)},
              {"entry", change.entry},
              {"before", to_json(change.before)},
              {"after", to_json(change.after)}};
}

ThreadChange thread_in(const Json &json) {
  ThreadChange change;
  change.thread = ThreadId{json.at("pid").get<std::int64_t>(), json.at("tid").get<std::int64_t>(),
                           json.at("start").get<std::uint64_t>()};
  change.name = printable(json.at("name").get<std::string>());
  change.program = printable(json.at("program").get<std::string>());
  change.entry = printable(json.at("entry").get<std::string>());
  change.before = state_in(json.at("before"));
  change.after = state_in(json.at("after"));
  return change;
}

Json to_json(const InterruptChange &change) {
  return Json{{"number", change.number},
              {"name", printable(change.name)},
              {"before", to_json(change.before)},
              {"after", to_json(change.after)}};
}

InterruptChange interrupt_in(const Json &json) {
  return InterruptChange{number_in(json, "number", 0, 1 << 30), printable(json.at("name").get<std::string>()),
                         cpus_in(json.at("before")), cpus_in(json.at("after"))};
}

// True if every part of the state is one that was before the change or after it. A change has two system calls, and a
// process can be killed between them.
bool is_of(const ThreadChange &change, const ThreadState &now) {
  return (now.scheduling == change.before.scheduling || now.scheduling == change.after.scheduling) &&
         (now.cpus == change.before.cpus || now.cpus == change.after.cpus);
}

bool is_of(const InterruptChange &change, const std::vector<int> &now) { return now == change.after; }

std::string system_error() { return std::strerror(errno); }

}  // namespace

Arrangement::Arrangement(Arrangement &&other) noexcept
    : system_(other.system_),
      path_(std::move(other.path_)),
      lock_(std::exchange(other.lock_, -1)),
      threads_(std::move(other.threads_)),
      interrupts_(std::move(other.interrupts_)) {}

Arrangement::~Arrangement() {
  if (lock_ >= 0) ::close(lock_);
}

Result<Arrangement> Arrangement::open(const System &system, std::string path) {
  Arrangement arrangement(system, std::move(path));
  const std::string lock = arrangement.path_ + ".lock";
  arrangement.lock_ = ::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (arrangement.lock_ < 0) {
    return trace::file_error(lock, 0, "cannot create: " + system_error(), "name another file with --state");
  }
  if (::flock(arrangement.lock_, LOCK_EX | LOCK_NB) != 0) {
    return trace::file_error(lock, 0, "another 'redag arrange' works on this robot", "end it first");
  }
  if (Result<void> loaded = arrangement.load(); !loaded) return tl::unexpected<Diagnostics>(std::move(loaded.error()));
  return arrangement;
}

Result<void> Arrangement::load() {
  std::error_code ignored;
  if (!std::filesystem::exists(std::filesystem::symlink_status(path_, ignored))) return {};
  const Result<std::string> text = trace::read_file(path_, kMostBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  const auto refuse = [this](const char *why) {
    return trace::file_error(path_, 0, fmt::format("is not the state of an arrangement: {}", why),
                             "name another file with --state");
  };
  if (json_is_too_large(*text)) return refuse("it is nested too deeply, or has too many values");
  try {
    const Json json = Json::parse(*text);
    if (json.at("format") != kFormat) return refuse("it has another format");
    // Numbers of threads and starts count from the boot.
    if (json.at("boot").get<std::string>() != system_.boot()) return {};
    for (const Json &each : json.at("threads")) threads_.push_back(thread_in(each));
    for (const Json &each : json.at("interrupts")) interrupts_.push_back(interrupt_in(each));
  } catch (const std::exception &error) {
    return refuse(error.what());
  }
  return {};
}

Result<void> Arrangement::save() const {
  if (is_empty()) {
    if (::unlink(path_.c_str()) == 0 || errno == ENOENT) return {};
    return trace::file_error(path_, 0, "cannot remove: " + system_error());
  }
  Json json = {
      {"format", kFormat}, {"boot", system_.boot()}, {"threads", Json::array()}, {"interrupts", Json::array()}};
  for (const ThreadChange &change : threads_) json["threads"].push_back(to_json(change));
  for (const InterruptChange &change : interrupts_) json["interrupts"].push_back(to_json(change));
  Result<trace::OutputFile> file = trace::OutputFile::create(path_);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  file->write(json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  return file->commit();
}

void Arrangement::drop_ended() {
  std::erase_if(threads_, [this](const ThreadChange &change) { return !system_.state_of(change.thread); });
}

// Notes the changes. What is noted already keeps its oldest state.
void Arrangement::remember(const Changes &changes) {
  for (const ThreadChange &change : changes.threads) {
    const auto known = std::find_if(threads_.begin(), threads_.end(),
                                    [&](const ThreadChange &each) { return each.thread == change.thread; });
    if (known == threads_.end()) {
      threads_.push_back(change);
    } else {
      known->after = change.after;
    }
  }
  for (const InterruptChange &change : changes.interrupts) {
    const auto known = std::find_if(interrupts_.begin(), interrupts_.end(),
                                    [&](const InterruptChange &each) { return each.number == change.number; });
    if (known == interrupts_.end()) {
      interrupts_.push_back(change);
    } else {
      known->after = change.after;
    }
  }
}

// Gives everything what it had before `changes`, as far as possible. The file still knows the rest.
void Arrangement::revert(const Changes &changes) {
  for (const ThreadChange &change : changes.threads) {
    static_cast<void>(system_.set(change.thread, change.name, change.before));
  }
  for (const InterruptChange &change : changes.interrupts) {
    if (system_.cpus_of(change.number) == change.after) {
      static_cast<void>(system_.set_cpus(change.number, change.before));
    }
  }
}

Result<bool> Arrangement::apply(const Changes &changes, const std::function<bool()> &stop) {
  if (changes.is_empty()) return true;
  const std::vector<ThreadChange> threads = threads_;
  const std::vector<InterruptChange> interrupts = interrupts_;
  drop_ended();
  remember(changes);
  Result<void> done = save();
  if (!done) {
    threads_ = threads;
    interrupts_ = interrupts;
    return tl::unexpected<Diagnostics>(std::move(done.error()));
  }
  bool is_stopped = false;
  for (auto change = changes.threads.begin(); change != changes.threads.end() && done && !is_stopped; ++change) {
    is_stopped = stop();
    if (!is_stopped) done = system_.set(change->thread, change->name, change->after);
  }
  for (auto change = changes.interrupts.begin(); change != changes.interrupts.end() && done && !is_stopped; ++change) {
    is_stopped = stop();
    if (!is_stopped) done = system_.set_cpus(change->number, change->after);
  }
  if (done && !is_stopped) return true;
  revert(changes);
  threads_ = threads;
  interrupts_ = interrupts;
  drop_ended();
  if (const Result<void> saved = save(); done && !saved) done = saved;
  if (!done) return tl::unexpected<Diagnostics>(std::move(done.error()));
  return false;
}

Result<Arrangement::Undone> Arrangement::undo() {
  Undone undone;
  Diagnostics failures;
  const auto restore = [&](const auto &now, const auto &change, const std::string &what, const auto &set) {
    if (!now || *now == change.before) return true;
    if (!is_of(change, *now)) {
      undone.remarks.push_back(what + " has been changed by others since, and is left as it is");
      return true;
    }
    const Result<void> done = set();
    if (done) ++undone.restored;
    if (!done) failures.insert(failures.end(), done.error().begin(), done.error().end());
    return done.has_value();
  };
  std::erase_if(threads_, [&](const ThreadChange &change) {
    return restore(system_.state_of(change.thread), change,
                   fmt::format("thread '{}' ({} of {})", change.name, change.thread.tid, change.program),
                   [&] { return system_.set(change.thread, change.name, change.before); });
  });
  std::erase_if(interrupts_, [&](const InterruptChange &change) {
    return restore(system_.cpus_of(change.number), change, fmt::format("interrupt {}", change.number),
                   [&] { return system_.set_cpus(change.number, change.before); });
  });
  if (Result<void> saved = save(); !saved) {
    failures.insert(failures.end(), saved.error().begin(), saved.error().end());
  }
  if (!failures.empty()) return tl::unexpected<Diagnostics>(std::move(failures));
  return undone;
}

}  // namespace redag::robot
