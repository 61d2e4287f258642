// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// libredag_lttng.so: hands the events of every executor of its process to LTTng. It is loaded beside a program
// (LD_PRELOAD) or linked to it; the executor itself needs no LTTng.
#define LTTNG_UST_TRACEPOINT_CREATE_PROBES
#define LTTNG_UST_TRACEPOINT_DEFINE
#include "redag/lttng/tracepoints.h"

#include <dlfcn.h>

#include <iterator>

#include "redag/trace/tap.hpp"

namespace redag::lttng {
namespace {

// In order of Reason; to_string() belongs to the executor's library, of which this one uses nothing.
constexpr const char *kReasons[] = {"none",    "overrun",   "precedence", "queue_full", "dag_full",
                                    "removed", "exception", "budget",     "no_data",    "degraded"};
static_assert(std::size(kReasons) == static_cast<std::size_t>(kLastReason) + 1);

const char *reason_of(const JobEvent &event) {
  const auto index = static_cast<std::size_t>(event.reason);
  return index < std::size(kReasons) ? kReasons[index] : "?";
}

void on_task(const void *executor, TaskId id, DagId dag, const Task &task) noexcept {
  lttng_ust_tracepoint(redag, task, executor, id.value, dag.value, task.name.c_str(), task.period, task.deadline);
}

// The kinds of JobEvent and the names of their tracepoints.
#define REDAG_KINDS(case_of)                                                                                           \
  case_of(Released, released) case_of(Ready, ready) case_of(Deferred, deferred) case_of(Dispatched, dispatched)        \
      case_of(Started, started) case_of(Preempted, preempted) case_of(Resumed, resumed) case_of(Finished, finished)    \
          case_of(Skipped, skipped) case_of(Aborted, aborted) case_of(Exceeded, exceeded) case_of(HighMode, high_mode) \
              case_of(LowMode, low_mode) case_of(Executed, executed) case_of(Waits, waits) case_of(Served, served)     \
                  case_of(Woken, woken)

#define REDAG_RECORD(kind, name)                                                                                 \
  case JobEventKind::kind:                                                                                       \
    lttng_ust_do_tracepoint(redag, name, executor, event.task.value, event.job,                                  \
                            static_cast<std::int32_t>(event.worker), event.time, event.value, reason_of(event)); \
    break;

// Apart, so that on_event() saves no registers while no session wants the event.
[[gnu::noinline, gnu::cold]] void record(const void *executor, const JobEvent &event) noexcept {
  switch (event.kind) { REDAG_KINDS(REDAG_RECORD) }
}

#define REDAG_ASK(kind, name)                                               \
  case JobEventKind::kind:                                                  \
    if (lttng_ust_tracepoint_enabled(redag, name)) record(executor, event); \
    break;

void on_event(const void *executor, const JobEvent &event) noexcept {
  switch (event.kind) { REDAG_KINDS(REDAG_ASK) }
}

void on_late(const void *executor, const JobEvent &finished, Duration lateness) noexcept {
  lttng_ust_tracepoint(redag, deadline_missed, executor, finished.task.value, finished.job, finished.time, lateness);
}

constexpr trace::Tap kTap = {on_task, on_event, on_late};

// A program without an executor, such as the shell of a script that was started with LD_PRELOAD, has nothing to trace.
[[gnu::constructor]] void listen() {
  using SetTap = decltype(&redag_set_tap);
  if (const auto set = reinterpret_cast<SetTap>(::dlsym(RTLD_DEFAULT, "redag_set_tap")); set != nullptr) set(&kTap);
}

}  // namespace
}  // namespace redag::lttng
