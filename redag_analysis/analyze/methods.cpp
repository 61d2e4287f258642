// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The registry: one line a method, in the order of a report.
#include "redag_analysis/any_features/by_demand.hpp"
#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/dag_isolated.hpp"
#include "redag_analysis/many_workers/dag_shapes.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/many_workers/global_edf.hpp"
#include "redag_analysis/many_workers/global_groups.hpp"
#include "redag_analysis/many_workers/global_sequential.hpp"
#include "redag_analysis/many_workers/suspension_aware.hpp"
#include "redag_analysis/one_worker/amc.hpp"
#include "redag_analysis/one_worker/edf_demand.hpp"
#include "redag_analysis/one_worker/offsets.hpp"
#include "redag_analysis/one_worker/paper.hpp"
#include "redag_analysis/one_worker/response_time.hpp"

namespace redag::analysis {

const std::vector<Method> &methods() {
  static const std::vector<Method> kAll = {
      // One worker, static priorities
      rta_preemptive(),
      rta_nonpreemptive(),
      rta_deferred(),
      offsets(),
      amc_rtb(),
      // One worker, edf
      edf_demand(),
      edf_demand_nonpreemptive(),
      // Several workers
      guan(),
      sequential_nonpreemptive(),
      dag_shapes(),
      dag_bounded(),
      dag_nonpreemptive(),
      isolated(),
      dag_groups(),
      dag_any(),
      // Tasks that wait
      suspension_aware(),
      suspension_aware_any(),
      // Several workers, edf
      edf_global_response(),
      edf_global_density(),
      // All features
      by_demand(),
      // The equations of the paper
      paper_rm_bound(),
      paper_interference(),
      paper_rta(),
      paper_rta_blocking(),
  };
  return kAll;
}

}  // namespace redag::analysis
