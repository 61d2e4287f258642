// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The tracepoints of provider `redag`: an event for each kind of JobEvent, with the names that `redag events` prints, one for late
// jobs, and one that names each task. LTTng reads this header several times, hence no `#pragma once`.
#undef LTTNG_UST_TRACEPOINT_PROVIDER
#define LTTNG_UST_TRACEPOINT_PROVIDER redag
#undef LTTNG_UST_TRACEPOINT_INCLUDE
#define LTTNG_UST_TRACEPOINT_INCLUDE "redag/lttng/tracepoints.h"

#if !defined(REDAG_LTTNG_TRACEPOINTS_H) || defined(LTTNG_UST_TRACEPOINT_HEADER_MULTI_READ)
#define REDAG_LTTNG_TRACEPOINTS_H

#include <lttng/tracepoint.h>
#include <stdint.h>  // NOLINT(modernize-deprecated-headers): a header of C

// clang-format off
LTTNG_UST_TRACEPOINT_EVENT_CLASS(redag, job_event,
  LTTNG_UST_TP_ARGS(const void *, executor, uint32_t, task, uint32_t, job, int32_t, worker, int64_t, time_ns,
                    int64_t, value_ns, const char *, reason),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer_hex(uintptr_t, executor, (uintptr_t)executor)
    lttng_ust_field_integer(uint32_t, task, task)
    lttng_ust_field_integer(uint32_t, job, job)
    lttng_ust_field_integer(int32_t, worker, worker)
    lttng_ust_field_integer(int64_t, time_ns, time_ns)
    lttng_ust_field_integer(int64_t, value_ns, value_ns)
    lttng_ust_field_string(reason, reason)))

#define REDAG_JOB_EVENT(name)                                                                                      \
  LTTNG_UST_TRACEPOINT_EVENT_INSTANCE(redag, job_event, redag, name,                                               \
    LTTNG_UST_TP_ARGS(const void *, executor, uint32_t, task, uint32_t, job, int32_t, worker, int64_t, time_ns,    \
                      int64_t, value_ns, const char *, reason))
REDAG_JOB_EVENT(released)
REDAG_JOB_EVENT(ready)
REDAG_JOB_EVENT(deferred)
REDAG_JOB_EVENT(dispatched)
REDAG_JOB_EVENT(started)
REDAG_JOB_EVENT(preempted)
REDAG_JOB_EVENT(resumed)
REDAG_JOB_EVENT(finished)
REDAG_JOB_EVENT(skipped)
REDAG_JOB_EVENT(aborted)
REDAG_JOB_EVENT(exceeded)
REDAG_JOB_EVENT(high_mode)
REDAG_JOB_EVENT(low_mode)
REDAG_JOB_EVENT(executed)
REDAG_JOB_EVENT(waits)
REDAG_JOB_EVENT(served)
REDAG_JOB_EVENT(woken)

LTTNG_UST_TRACEPOINT_EVENT(redag, deadline_missed,
  LTTNG_UST_TP_ARGS(const void *, executor, uint32_t, task, uint32_t, job, int64_t, time_ns, int64_t, lateness_ns),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer_hex(uintptr_t, executor, (uintptr_t)executor)
    lttng_ust_field_integer(uint32_t, task, task)
    lttng_ust_field_integer(uint32_t, job, job)
    lttng_ust_field_integer(int64_t, time_ns, time_ns)
    lttng_ust_field_integer(int64_t, lateness_ns, lateness_ns)))

LTTNG_UST_TRACEPOINT_EVENT(redag, task,
  LTTNG_UST_TP_ARGS(const void *, executor, uint32_t, task, uint32_t, dag, const char *, name, int64_t, period_ns,
                    int64_t, deadline_ns),
  LTTNG_UST_TP_FIELDS(
    lttng_ust_field_integer_hex(uintptr_t, executor, (uintptr_t)executor)
    lttng_ust_field_integer(uint32_t, task, task)
    lttng_ust_field_integer(uint32_t, dag, dag)
    lttng_ust_field_string(name, name)
    lttng_ust_field_integer(int64_t, period_ns, period_ns)
    lttng_ust_field_integer(int64_t, deadline_ns, deadline_ns)))
// clang-format on

#endif

#include <lttng/tracepoint-event.h>
