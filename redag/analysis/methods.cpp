#include "redag/analysis/bound.hpp"
#include "redag/analysis/global_dag.hpp"
#include "redag/analysis/global_sequential.hpp"
#include "redag/analysis/response_time.hpp"

namespace redag::analysis {

const std::vector<Method> &methods() {
  static const std::vector<Method> all = {
      rta_preemptive(), rta_nonpreemptive(), rta_deferred(), dag_one_worker_preemptive(), dag_one_worker_deferred(),
      guan(), bertogna_cirinei(), bertogna_cirinei_any(), sequential_nonpreemptive(), melani(), dag_bounded(),
      dag_nonpreemptive(),
  };
  return all;
}

}  // namespace redag::analysis
