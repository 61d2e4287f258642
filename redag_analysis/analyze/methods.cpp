// The registry: one line a method, in the order of a report.
#include "redag/analysis/amc.hpp"
#include "redag/analysis/bound.hpp"
#include "redag/analysis/dag_isolated.hpp"
#include "redag/analysis/dag_shapes.hpp"
#include "redag/analysis/edf_demand.hpp"
#include "redag/analysis/exact_points.hpp"
#include "redag/analysis/global_dag.hpp"
#include "redag/analysis/global_edf.hpp"
#include "redag/analysis/global_groups.hpp"
#include "redag/analysis/global_sequential.hpp"
#include "redag/analysis/linear_bound.hpp"
#include "redag/analysis/paper.hpp"
#include "redag/analysis/response_time.hpp"
#include "redag/analysis/utilization.hpp"

namespace redag::analysis {

const std::vector<Method> &methods() {
  static const std::vector<Method> kAll = {
      // One worker, static priorities
      rta_preemptive(),
      rta_nonpreemptive(),
      rta_deferred(),
      dag_one_worker_preemptive(),
      dag_one_worker_deferred(),
      exact_points(),
      linear_bound(),
      amc_rtb(),
      // One worker, edf
      edf_demand(),
      edf_demand_nonpreemptive(),
      // Several workers
      guan(),
      bertogna_cirinei(),
      bertogna_cirinei_any(),
      sequential_nonpreemptive(),
      melani(),
      dag_shapes(),
      dag_bounded(),
      dag_nonpreemptive(),
      graham(),
      long_paths(),
      isolated(),
      dag_groups(),
      dag_any(),
      // Several workers, edf
      edf_global_response(),
      edf_global_density(),
      // Utilization
      liu_layland(),
      hyperbolic(),
      harmonic_chains(),
      liu_layland_blocking(),
      hyperbolic_blocking(),
      global_rm_light(),
      global_rm_utilization(),
      // The paper's own
      paper_rm_bound(),
      paper_interference(),
      paper_rta(),
      paper_rta_blocking(),
  };
  return kAll;
}

}  // namespace redag::analysis
