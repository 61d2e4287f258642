// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/ranks.hpp"

#ifdef REDAG_MPI

#include <mpi.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <list>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "redag/base/lines.hpp"
#include "redag_lab/experiment/unit_dispenser.hpp"

namespace redag::experiment {
namespace {

using Clock = std::chrono::steady_clock;
using Units = std::vector<std::uint64_t>;

// Messages to rank 0 are text: a line for each unit, "unit,result". Messages from it are numbers of units.
enum Tag : int {
  Hello,    // to 0: the subject
  Results,  // to 0: finished units
  Failed,   // to 0: why a unit could not be evaluated
  Bye,      // to 0: this rank takes no more units
  Work,     // from 0: units to evaluate
  Stop,     // from 0: end, and say Bye
  Alive,    // from 0, now and then
  End,      // from 0: [1] finalize MPI, as all ranks do; [0] just leave
};

constexpr std::chrono::milliseconds kNap{1};  // between looks for messages
constexpr std::chrono::seconds kSilence{5};   // after Stop; a rank that does not answer then is lost
constexpr std::chrono::seconds kAliveEvery{5};
constexpr std::chrono::seconds kOrphaned{60};     // without a word of rank 0, which must be lost
constexpr std::chrono::milliseconds kHurry{300};  // instead of kSilence after Ctrl-C: a second later mpirun kills

Time now() { return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count(); }

// True if this launcher keeps the others alive when a rank dies. Elsewhere all ranks have to end together.
bool ranks_may_be_lost() {
  const char *recovery = std::getenv("OMPI_MCA_orte_enable_recovery");
  return recovery != nullptr && std::string_view(recovery) == "1";
}

/// Evaluates one batch at a time on threads of its own, while the main thread looks after messages.
class Worker {
 public:
  Worker(const RunnerOptions &options, const Evaluate &evaluate) : jobs_(options.jobs), evaluate_(evaluate) {}
  ~Worker() {
    stop();
    if (batch_.valid()) batch_.wait();
  }
  Worker(const Worker &) = delete;
  Worker &operator=(const Worker &) = delete;

  [[nodiscard]] bool idle() const { return !batch_.valid(); }
  void stop() { stop_.store(true, std::memory_order_relaxed); }
  void start(Units units) {
    batch_ =
        std::async(std::launch::async, [this, units = std::move(units)]() mutable { return run(std::move(units)); });
  }
  /// Returns the results of a batch that has ended: a line for each unit.
  [[nodiscard]] std::optional<Result<std::string>> ended() {
    if (idle() || batch_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return std::nullopt;
    return batch_.get();
  }

 private:
  Result<std::string> run(Units units) {
    std::string lines;
    const auto keep = [&lines](std::uint64_t unit, const std::string &result) -> Result<void> {
      lines += fmt::format("{},{}\n", unit, result);
      return {};
    };
    const Result<std::uint64_t> ran = run_units(units_of(std::move(units)), {jobs_, &stop_}, evaluate_, keep);
    if (!ran) return tl::unexpected<Diagnostics>(ran.error());
    return lines;
  }

  std::uint32_t jobs_;
  const Evaluate &evaluate_;
  std::atomic<bool> stop_{false};
  std::future<Result<std::string>> batch_;
};

Result<void> accept_lines(std::string_view lines, UnitDispenser &dispenser) {
  while (!lines.empty()) {
    const std::string_view line = next_line(lines);
    std::uint64_t unit = 0;
    const auto parsed = std::from_chars(line.data(), line.data() + line.size(), unit);
    const auto digits = static_cast<std::size_t>(parsed.ptr - line.data());
    if (Result<void> done = dispenser.finish(unit, std::string(line.substr(digits + 1))); !done) return done;
  }
  return {};
}

/// Messages that are under way. A message of a lost rank never ends, and holds up no other.
class Mail {
 public:
  struct Received {
    int rank;
    int tag;
    std::string text;
  };

  void send(int rank, int tag, const std::string &text) {
    Message &message = outgoing_.emplace_back(Message{rank, tag, text, MPI_REQUEST_NULL});
    MPI_Isend(message.text.data(), static_cast<int>(message.text.size()), MPI_BYTE, rank, tag, MPI_COMM_WORLD,
              &message.request);
  }
  void send(int rank, int tag, const Units &units) {
    send(rank, tag, std::string(static_cast<const char *>(static_cast<const void *>(units.data())), units.size() * 8));
  }

  /// Returns a message that has arrived as a whole.
  [[nodiscard]] std::optional<Received> receive() {
    outgoing_.remove_if([](Message &message) { return message.ended(); });
    for (int any = 1; any != 0;) {
      MPI_Message handle = MPI_MESSAGE_NULL;
      MPI_Status status;
      MPI_Improbe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &any, &handle, &status);
      if (any == 0) break;
      int bytes = 0;
      MPI_Get_count(&status, MPI_BYTE, &bytes);
      Message &message = incoming_.emplace_back(Message{status.MPI_SOURCE, status.MPI_TAG, {}, MPI_REQUEST_NULL});
      message.text.resize(static_cast<std::size_t>(bytes));
      MPI_Imrecv(message.text.data(), bytes, MPI_BYTE, &handle, &message.request);
    }
    const auto ended =
        std::find_if(incoming_.begin(), incoming_.end(), [](Message &message) { return message.ended(); });
    if (ended == incoming_.end()) return std::nullopt;
    Received received{ended->rank, ended->tag, std::move(ended->text)};
    incoming_.erase(ended);
    return received;
  }
  [[nodiscard]] bool all_sent() {
    outgoing_.remove_if([](Message &message) { return message.ended(); });
    return outgoing_.empty();
  }

 private:
  struct Message {
    int rank;
    int tag;
    std::string text;
    MPI_Request request;

    [[nodiscard]] bool ended() {
      int done = 0;
      MPI_Test(&request, &done, MPI_STATUS_IGNORE);
      return done != 0;
    }
  };
  std::list<Message> outgoing_;  // a list: MPI knows the addresses
  std::list<Message> incoming_;
};

Units numbers(const std::string &text) {
  Units units(text.size() / 8);
  text.copy(static_cast<char *>(static_cast<void *>(units.data())), units.size() * 8);
  return units;
}

class MpiRanks final : public Ranks {
 public:
  MpiRanks() {
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
  }
  [[nodiscard]] std::uint32_t rank() const override { return static_cast<std::uint32_t>(rank_); }
  [[nodiscard]] std::uint32_t size() const override { return static_cast<std::uint32_t>(size_); }

  Result<LeadReport> lead(const std::string &subject, const NextUnit &next, std::uint64_t count,
                          const RunnerOptions &options, const Evaluate &evaluate, const Accept &accept) override {
    UnitDispenser dispenser(next, count, size(), options.jobs, accept);
    Worker worker(options, evaluate);
    Lead lead{dispenser, subject, std::vector<State>(size(), State::Starting), {}};
    Clock::time_point alive = Clock::now();
    while (!dispenser.finished() && !options.stop->load() && lead.error.empty()) {
      bool busy = false;
      if (Clock::now() - alive > kAliveEvery) {
        alive = Clock::now();
        for (int rank = 1; rank < size_; ++rank) mail_.send(rank, Alive, std::string());
      }
      if (auto ended = worker.ended()) {
        busy = true;
        note(lead, *ended ? accept_lines(**ended, dispenser) : tl::unexpected<Diagnostics>(ended->error()));
      }
      while (const auto message = mail_.receive()) {
        busy = true;
        note(lead, handle(lead, *message));
      }
      if (worker.idle() && !dispenser.finished()) {
        if (Units units = dispenser.take(0, now()); !units.empty()) worker.start(std::move(units));
      }
      for (int rank = 1; rank < size_; ++rank) {
        State &state = lead.states[static_cast<std::size_t>(rank)];
        if (state != State::Idle || dispenser.finished()) continue;
        const Units units = dispenser.take(static_cast<std::uint32_t>(rank), now());
        if (units.empty()) continue;
        mail_.send(rank, Work, units);
        state = State::Busy;
      }
      if (!busy) std::this_thread::sleep_for(kNap);
    }
    return finish(lead, worker, options.stop->load());
  }

  Result<void> follow(const std::string &subject, const RunnerOptions &options, const Evaluate &evaluate) override {
    Worker worker(options, evaluate);
    mail_.send(0, Hello, subject);
    Clock::time_point heard = Clock::now();
    bool stopping = false;
    bool said_bye = false;
    while (Clock::now() - heard < kOrphaned) {
      bool busy = false;
      if (options.stop->load()) worker.stop();
      if (auto ended = worker.ended()) {
        busy = true;
        mail_.send(0, *ended ? Results : Failed, *ended ? **ended : to_string(ended->error()));
      }
      while (const auto message = mail_.receive()) {
        busy = true;
        heard = Clock::now();
        if (message->tag == Work) worker.start(numbers(message->text));
        if (message->tag == Stop) {
          worker.stop();
          stopping = true;
        }
        if (message->tag == End) {
          together_ = numbers(message->text).front() == 1;
          return {};
        }
      }
      if (worker.idle() && (stopping || options.stop->load()) && !said_bye) {
        mail_.send(0, Bye, std::string());
        said_bye = true;
      }
      if (!busy) std::this_thread::sleep_for(kNap);
    }
    return make_error("rank 0 no longer answers", "the same command goes on with the units that are not written");
  }

  void leave(int status) override {
    std::fflush(nullptr);
    if (together_) MPI_Finalize();
    ::_exit(status);
  }

 private:
  enum class State : std::uint8_t { Starting, Idle, Busy, Gone };
  struct Lead {
    UnitDispenser &dispenser;
    const std::string &subject;
    std::vector<State> states;
    Diagnostics error;
  };

  static void note(Lead &lead, Result<void> result) {
    if (!result && lead.error.empty()) lead.error = std::move(result.error());
  }

  static Result<void> handle(Lead &lead, const Mail::Received &message) {
    State &state = lead.states[static_cast<std::size_t>(message.rank)];
    switch (message.tag) {
      case Hello:
        state = State::Idle;
        if (message.text == lead.subject) return {};
        return make_error(fmt::format("rank {} runs another version of redag or another plan", message.rank),
                          "install the same redag on all machines of the run");
      case Failed: state = State::Idle; return make_error(fmt::format("rank {}: {}", message.rank, message.text));
      case Bye: state = State::Gone; return {};
      default:
        if (state != State::Gone) state = State::Idle;
        return accept_lines(message.text, lead.dispenser);
    }
  }

  // Ends the other ranks. Units that they finish meanwhile count.
  Result<LeadReport> finish(Lead &lead, Worker &worker, bool hurry) {
    worker.stop();
    for (int rank = 1; rank < size_; ++rank) mail_.send(rank, Stop, std::string());
    const auto begin = Clock::now();
    const Clock::duration patience = hurry                 ? Clock::duration(kHurry)
                                     : ranks_may_be_lost() ? Clock::duration(kSilence)
                                                           : Clock::duration::max();
    const auto silent = [&lead] {
      return std::count_if(lead.states.begin() + 1, lead.states.end(),
                           [](State state) { return state != State::Gone; });
    };
    while ((silent() > 0 || !worker.idle()) && Clock::now() - begin < patience) {
      if (auto ended = worker.ended(); ended && *ended) note(lead, accept_lines(**ended, lead.dispenser));
      if (const auto message = mail_.receive()) {
        note(lead, handle(lead, *message));
      } else {
        std::this_thread::sleep_for(kNap);
      }
    }
    together_ = silent() == 0;
    for (int rank = 1; rank < size_; ++rank) mail_.send(rank, End, Units{together_ ? 1U : 0U});
    for (const auto end = Clock::now() + kHurry; !mail_.all_sent() && Clock::now() < end;) {
      std::this_thread::sleep_for(kNap);
    }
    if (!lead.error.empty()) return tl::unexpected<Diagnostics>(std::move(lead.error));
    return LeadReport{lead.dispenser.repeated(), static_cast<std::uint32_t>(silent())};
  }

  int rank_ = 0;
  int size_ = 1;
  bool together_ = false;
  Mail mail_;
};

}  // namespace

Result<std::unique_ptr<Ranks>> Ranks::join() {
  int provided = MPI_THREAD_SINGLE;
  if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided) != MPI_SUCCESS) {
    return make_error("MPI does not start", "start the command with mpirun");
  }
  return std::make_unique<MpiRanks>();
}

}  // namespace redag::experiment

#else

namespace redag::experiment {

Result<std::unique_ptr<Ranks>> Ranks::join() {
  return make_error("--mpi: this redag was built without MPI", "build it with cmake -DREDAG_MPI=ON");
}

}  // namespace redag::experiment

#endif
