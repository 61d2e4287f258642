// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The whole interface of the library, for programs that run their own DAGs or those of a workload.
#pragma once

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/engine/coroutine.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/runtime/blocking.hpp"
#include "redag/runtime/dag_builder.hpp"
#include "redag/runtime/device_handle.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/runtime/executor_options.hpp"
#include "redag/runtime/stats.hpp"
#include "redag/version.hpp"
