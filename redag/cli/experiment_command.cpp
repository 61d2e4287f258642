#include <memory>
#include <string>
#include <vector>

#include "redag/cli/commands.hpp"
#include "redag/cli/experiment_run.hpp"
#include "redag/cli/experiment_studies.hpp"

namespace redag::cli {
namespace {

struct MergeSettings {
  std::vector<std::string> folders;
  StudyOutput output;
};

// Whatever the plan says is wrong with it, one of the readers finds: the one that its first line names.
std::unique_ptr<Study> make_study(const std::string &plan, const std::string &file, Console &console) {
  if (plan.starts_with("experiment: factorial\n")) return make_factorial(plan, file, console);
  return make_acceptance(plan, file, console);
}

Action add_merge(CLI::App &app) {
  const auto settings = std::make_shared<MergeSettings>();
  app.add_option("DIR", settings->folders, "Folders of the shards (--out); the same plan in all")
      ->type_name("DIR")
      ->required();
  add_study_output(app, settings->output, "-o,--out", "Folder for the whole");
  app.get_option("--out")->required();
  app.footer("Examples:\n  redag experiment merge results/dags-1 results/dags-2 results/dags-3 --out results/dags\n");
  return
      [settings](Console &console) { return merge_studies(settings->folders, settings->output, make_study, console); };
}

}  // namespace

Action add_experiment(CLI::App &app) {
  app.require_subcommand(1);
  CLI::App *acceptance =
      app.add_subcommand("acceptance", "Which share of random workloads do the bounds accept, over utilization?");
  CLI::App *factorial =
      app.add_subcommand("factorial", "Every executor on every combination of workers, deadlines, bounds, load, ...");
  CLI::App *together = app.add_subcommand("merge", "Put the shards of several machines together");
  return [acceptance, factorial, judge = add_acceptance(*acceptance), cross = add_factorial(*factorial),
          join = add_merge(*together)](Console &console) {
    if (acceptance->parsed()) return judge(console);
    return (factorial->parsed() ? cross : join)(console);
  };
}

}  // namespace redag::cli
