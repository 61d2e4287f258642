#include "core.hpp"

#include <fmt/format.h>
#include <pthread.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "compat.hpp"
#include "middleware_threads.hpp"
#include "rclcpp/logging.hpp"
#include "redag/model/validate.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/sched/priority_scheduler.hpp"

namespace redag_rclcpp {

using redag::CallbackId;
using redag::DagId;
using redag::JobEvent;
using redag::kNever;
using redag::Task;
using redag::Workload;
using redag::runtime::monotonic_now;
using std::chrono::nanoseconds;
using Kind = redag::Callback::Kind;

namespace {

constexpr std::uint32_t kSpareThreads = 16;
constexpr redag::Duration kNodesAppear = 3 * redag::kSecond;  // after the first spin: then names should match

rclcpp::Logger logger() { return rclcpp::get_logger("redag_rclcpp"); }

/// The calling thread at SCHED_FIFO `priority` for as long as this lives; 0: as it is.
class RaisedThread {
 public:
  explicit RaisedThread(int priority) {
    if (priority == 0 || pthread_getschedparam(pthread_self(), &policy_, &parameters_) != 0) return;
    raised_ = redag::runtime::set_fifo_priority(pthread_self(), priority);
  }
  ~RaisedThread() {
    if (raised_) pthread_setschedparam(pthread_self(), policy_, &parameters_);
  }
  RaisedThread(const RaisedThread &) = delete;
  RaisedThread &operator=(const RaisedThread &) = delete;

 private:
  bool raised_ = false;
  int policy_ = 0;
  sched_param parameters_{};
};

/// Makes tasks of a cycle tasks of their own: what was learned can be one, a DAG cannot.
void break_cycles(redag::Dag &dag) {
  std::vector<std::uint8_t> done(dag.tasks.size(), 0);
  const auto is_ready = [&](const Task &task) {
    return std::all_of(task.predecessors.begin(), task.predecessors.end(), [&](auto p) { return done[p] != 0; });
  };
  for (std::size_t left = dag.tasks.size(); left > 0;) {
    const std::size_t before = left;
    for (std::size_t t = 0; t < dag.tasks.size(); ++t) {
      if (done[t] != 0 || !is_ready(dag.tasks[t])) continue;
      done[t] = 1;
      --left;
    }
    if (left != before) continue;
    const auto first = static_cast<std::size_t>(std::find(done.begin(), done.end(), 0) - done.begin());
    dag.tasks[first].predecessors.clear();
    dag.tasks[first].activation = redag::Activation::Timer;
  }
}

}  // namespace

/// An entity as it stands in a callback group.
struct ReDAGExecutor::Core::Found {
  const void *key = nullptr;
  Kind kind = Kind::Timer;
  std::string node;
  rclcpp::CallbackGroup::SharedPtr group;
  rclcpp::TimerBase::SharedPtr timer;
  rclcpp::SubscriptionBase::SharedPtr subscription;
  rclcpp::Waitable::SharedPtr intra_process;
  rclcpp::ServiceBase::SharedPtr service;
  rclcpp::ClientBase::SharedPtr client;
  rclcpp::Waitable::SharedPtr waitable;
};

ReDAGExecutor::Core::Core(const rclcpp::Context::SharedPtr &context, ReDAGOptions options)
    : context_(context), options_(std::move(options)), band_(redag::runtime::probe_priority_band()), bridge_(context) {
  auto mode = redag::runtime::resolve_mode(options_.preemption, options_.policy, band_);
  if (!mode) throw std::runtime_error(to_string(mode.error()));
  mode_ = *std::move(mode);
  const std::size_t cpus = options_.cpus.empty() ? redag::runtime::usable_cpus().size() : options_.cpus.size();
  if (options_.workers == 0) options_.workers = static_cast<std::uint32_t>(cpus);
  if (options_.threads == 0) options_.threads = options_.workers + kSpareThreads;
  options_.threads = std::max(options_.threads, options_.workers);
  warnings_ = redag::runtime::mode_warnings(mode_, options_.workers, cpus);

  redag::runtime::EngineOptions engine;
  engine.config = redag::runtime::make_config(mode_, options_.workers, options_.policy, band_, options_.threads);
  engine.config.reuse_ids = options_.trace_capacity == 0;  // in a trace an id means one task
  engine.band = band_;
  engine.cpus = options_.cpus;
  engine.trace_capacity = options_.trace_capacity;
  engine.start_paused = true;
  engine.on_exception = [this](const redag::runtime::Job &job, std::exception_ptr e) { on_exception(job, e); };
  auto scheduler = std::make_unique<redag::sched::PriorityScheduler>(Workload{}, engine.config);
  engine_ = std::make_unique<redag::runtime::Engine>(std::move(scheduler), std::move(engine));
  origin_ = monotonic_now();
  engine_->set_origin(origin_);

  if (options_.workload) {
    const auto findings = redag::validate(*options_.workload, redag::ValidateOptions{.wcet_optional = true});
    if (has_errors(findings)) throw std::runtime_error(to_string(findings));
    for (redag::Dag &dag : options_.workload->dags) redag::inherit_periods(dag);
    matcher_.emplace(*options_.workload);
    for (const redag::Dag &dag : options_.workload->dags) {
      redag::Dag empty = dag;
      empty.tasks.clear();
      const DagId id = engine_->add_dag(empty, {}).dag;
      dags_.push_back(DagInfo{std::move(empty), id});
    }
  }
  // All that the workload does not name: no bound, and last among equals.
  redag::Dag others;
  others.name = "ros";
  const DagId id = engine_->add_dag(others, {}).dag;
  dags_.push_back(DagInfo{std::move(others), id});
}

ReDAGExecutor::Core::~Core() = default;

void ReDAGExecutor::Core::open(Host host, const std::vector<const rclcpp::GuardCondition *> &conditions) {
  host_ = std::move(host);
  for (const rclcpp::GuardCondition *condition : conditions) bridge_.watch(*condition);
}

void ReDAGExecutor::Core::close() {
  timer_exit_ = true;
  timer_parker_.unpark();
  if (timer_thread_.joinable()) timer_thread_.join();
  engine_->halt();
  engine_->join();
  const std::lock_guard guard(collect_lock_);
  closed_ = true;
  while (!callbacks_.empty()) remove(callbacks_.begin()->second);
  for (const auto &weak : nodes_) {
    if (const auto node = weak.lock()) node->get_notify_guard_condition().set_on_trigger_callback(nullptr);
  }
  for (const auto &[weak, name] : group_names_) {
    if (const auto group = weak.lock()) watch_group(*group, nullptr);
  }
  const std::lock_guard noted_guard(noted_lock_);
  noted_.clear();
}

// ---- nodes, groups, entities ----

void ReDAGExecutor::Core::change(const std::function<void()> &change) {
  {
    const std::lock_guard guard(collect_lock_);
    change();
  }
  collect();
}

void ReDAGExecutor::Core::add_node(const NodeBase::SharedPtr &node) {
  forget_gone_nodes();
  nodes_.push_back(node);
  node->get_notify_guard_condition().set_on_trigger_callback([weak = weak_from_this()](std::size_t) {
    if (const auto core = weak.lock()) core->mark_dirty();
  });
}

void ReDAGExecutor::Core::remove_node(const NodeBase::SharedPtr &node) {
  std::erase_if(nodes_, [&](const NodeBase::WeakPtr &weak) { return weak.lock() == node; });
  forget_gone_nodes();
  node->get_notify_guard_condition().set_on_trigger_callback(nullptr);
}

void ReDAGExecutor::Core::add_group(const rclcpp::CallbackGroup::SharedPtr &group, const NodeBase::SharedPtr &node) {
  forget_gone_nodes();
  manual_groups_[group] = node;
}

void ReDAGExecutor::Core::remove_group(const rclcpp::CallbackGroup::SharedPtr &group) { manual_groups_.erase(group); }

// Nodes need not be removed, only dropped. One that comes under the same name then begins to count anew.
void ReDAGExecutor::Core::forget_gone_nodes() {
  std::erase_if(nodes_, [](const NodeBase::WeakPtr &weak) { return weak.expired(); });
  std::erase_if(manual_groups_, [](const auto &entry) { return entry.first.expired() || entry.second.expired(); });
  std::set<std::string> names;
  const auto insert_name = [&](const NodeBase::WeakPtr &weak) {
    if (const auto node = weak.lock()) names.insert(node->get_fully_qualified_name());
  };
  for (const auto &weak : nodes_) insert_name(weak);
  for (const auto &[group, weak] : manual_groups_) insert_name(weak);
  std::erase_if(next_index_, [&](const auto &entry) { return names.count(entry.first.first) == 0; });
}

void ReDAGExecutor::Core::mark_dirty() {
  if (!dirty_.exchange(true)) bridge_.wake();
}

void ReDAGExecutor::Core::collect() {
  // What users own is destroyed after the lock is left, if we are the last to hold it.
  std::vector<Found> found;
  const std::lock_guard guard(collect_lock_);
  if (closed_) return;
  dirty_ = false;
  found = find_entities();
  std::map<const void *, const Found *> present;
  for (const Found &entity : found) present.emplace(entity.key, &entity);

  std::vector<std::shared_ptr<Callback>> gone;
  for (const auto &[key, callback] : callbacks_) {
    if (present.count(key) == 0 || !callback->alive()) gone.push_back(callback);
  }
  for (const auto &callback : gone) remove(callback);
  std::vector<std::shared_ptr<Callback>> added;
  for (const Found &entity : found) {
    if (callbacks_.count(entity.key) != 0) continue;
    add(entity);
    added.push_back(callbacks_.at(entity.key));
  }
  if (!added.empty() && rclcpp::ok(context_)) find_leftovers(context_, added);
}

std::vector<ReDAGExecutor::Core::Found> ReDAGExecutor::Core::find_entities() {
  // Before the nodes are asked: a group that is created meanwhile waits for the next time, rather than have no node.
  const auto groups = host_.groups();
  std::map<const rclcpp::CallbackGroup *, std::string> nodes;
  for (const auto &weak : nodes_) {
    if (const auto node = weak.lock()) {
      node->for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
        nodes.emplace(group.get(), node->get_fully_qualified_name());
      });
    }
  }
  for (const auto &[group, weak] : manual_groups_) {
    const auto node = weak.lock();
    if (const auto strong = group.lock(); strong && node) {
      nodes.emplace(strong.get(), node->get_fully_qualified_name());
    }
  }

  std::vector<Found> result;
  for (const auto &weak : groups) {
    const auto group = weak.lock();
    if (!group) continue;
    (void)group_name(group);  // also an empty one is watched: something may be created in it
    Found base;
    base.group = group;
    base.node = nodes[group.get()];
    std::set<const void *> intra_process;
    const auto push = [&](const void *key, Kind kind) -> Found & {
      result.push_back(base);
      result.back().key = key;
      result.back().kind = kind;
      return result.back();
    };
    group->collect_all_ptrs(
        [&](const rclcpp::SubscriptionBase::SharedPtr &subscription) {
          Found &found = push(subscription.get(), Kind::Subscription);
          found.subscription = subscription;
          try {
            found.intra_process = subscription->get_intra_process_waitable();
          } catch (const std::runtime_error &) {
            // Its intra-process manager is gone already.
          }
          if (found.intra_process) intra_process.insert(found.intra_process.get());
        },
        [&](const rclcpp::ServiceBase::SharedPtr &service) { push(service.get(), Kind::Service).service = service; },
        [&](const rclcpp::ClientBase::SharedPtr &client) { push(client.get(), Kind::Client).client = client; },
        [&](const rclcpp::TimerBase::SharedPtr &timer) { push(timer.get(), Kind::Timer).timer = timer; },
        [&](const rclcpp::Waitable::SharedPtr &waitable) {
          if (intra_process.count(waitable.get()) == 0) push(waitable.get(), Kind::Waitable).waitable = waitable;
        });
  }
  return result;
}

// The name under which the scheduler knows a mutually exclusive group. First time: also watches it for new entities.
std::string ReDAGExecutor::Core::group_name(const rclcpp::CallbackGroup::SharedPtr &group) {
  const auto [entry, is_new] = group_names_.try_emplace(group);
  if (is_new) {
    entry->second = "g" + std::to_string(next_group_++);
    watch_group(*group, [weak = weak_from_this()](std::size_t) {
      if (const auto core = weak.lock()) core->mark_dirty();
    });
    std::erase_if(group_names_, [](const auto &known) { return known.first.expired(); });
  }
  return group->type() == rclcpp::CallbackGroupType::MutuallyExclusive ? entry->second : std::string();
}

void ReDAGExecutor::Core::watch_group(rclcpp::CallbackGroup &group, const std::function<void(std::size_t)> &callback) {
  const auto condition = compat::notify_guard_condition(group, context_);
  if (condition) condition->set_on_trigger_callback(callback);
}

void ReDAGExecutor::Core::add(const Found &found) {
  Record record;
  record.id.kind = found.kind;
  record.id.node = found.node;
  if (found.subscription) record.id.name = found.subscription->get_topic_name();
  if (found.service) record.id.name = found.service->get_service_name();
  if (found.client) record.id.name = found.client->get_service_name();
  if (found.timer) {
    std::int64_t period = 0;
    if (rcl_timer_get_period(found.timer->get_timer_handle().get(), &period) == RCL_RET_OK) record.id.period = period;
  }
  if (found.timer || found.waitable) {
    record.id.index = next_index_[{found.node, static_cast<int>(found.kind)}]++;
  }
  place(record, found);

  std::shared_ptr<Callback> callback;
  const auto self = shared_from_this();
  if (found.timer) callback = std::make_shared<Callback>(self, record.id, found.timer);
  if (found.subscription) {
    callback = std::make_shared<Callback>(self, record.id, found.subscription, found.intra_process);
  }
  if (found.service) callback = std::make_shared<Callback>(self, record.id, found.service);
  if (found.client) callback = std::make_shared<Callback>(self, record.id, found.client);
  if (found.waitable) {
    callback = std::make_shared<Callback>(self, record.id, found.waitable, compat::needs_wait_set(*found.waitable));
  }
  record.callback = callback;
  callback->set_deadline(record.task.deadline);

  const redag::TaskId task =
      engine_->add_task(dags_[record.dag].id, record.rank, record.task,
                        [callback](const redag::runtime::Job &job) { return callback->execute(job); });
  {
    const std::lock_guard guard(records_lock_);
    if (records_.size() <= task.value) records_.resize(task.value + 1);
    records_[task.value] = std::move(record);
  }
  callbacks_[found.key] = callback;
  if (callback->attach(task)) bridge_.add(callback);
}

// Which task of which DAG the callback is, and with which parameters.
void ReDAGExecutor::Core::place(Record &record, const Found &found) {
  Task &task = record.task;
  record.dag = static_cast<std::uint32_t>(dags_.size() - 1);
  if (const auto ref = matcher_ ? matcher_->find(record.id) : std::nullopt) {
    task = *ref->task;
    record.dag = ref->dag.value;
    record.rank = redag::topological_ranks(options_.workload->dags[record.dag])[ref->index];
    record.configured = true;
  }
  if (task.period == 0) task.period = record.id.period > 0 ? record.id.period : options_.default_period.count();
  if (task.deadline == 0) task.deadline = task.period;
  // What releases its jobs, and what they must not overlap with, is ROS' business.
  task.activation = redag::Activation::Timer;
  task.predecessors.clear();
  task.offset = 0;
  task.jitter = 0;
  task.overrun = redag::Overrun::Skip;
  task.group = group_name(found.group);
  task.concurrency = task.group.empty() ? options_.workers : 1;
}

void ReDAGExecutor::Core::remove(const std::shared_ptr<Callback> &gone) {
  const std::shared_ptr<Callback> callback = gone;
  const auto entry = std::find_if(callbacks_.begin(), callbacks_.end(), [&](auto &e) { return e.second == callback; });
  if (entry != callbacks_.end()) callbacks_.erase(entry);
  callback->detach();
  {
    // Releases that were taken out of the timer queue before have been passed on: the id can be another task's now.
    const std::lock_guard guard(expire_lock_);
  }
  bridge_.remove(*callback);
  const redag::TaskId task = callback->task();
  {
    const std::lock_guard guard(records_lock_);
    records_[task.value].callback = nullptr;
  }
  engine_->remove_task(task);
}

// ---- arrivals ----

void ReDAGExecutor::Core::note(std::shared_ptr<Callback> callback) {
  const std::lock_guard guard(noted_lock_);
  noted_.push_back(std::move(callback));
}

void ReDAGExecutor::Core::wake() {
  // Read after note(): who is about to wait sees what was noted, or is seen here. While workers run, the spinning
  // thread takes what was noted just before they began.
  if (waiting_ || direct_) bridge_.wake();
}

void ReDAGExecutor::Core::timers_changed() {
  if (timing_) {
    timer_parker_.unpark();
  } else if (waiting_) {
    bridge_.wake();
  }
}

void ReDAGExecutor::Core::wait_set_changed() {
  if (waiting_ || direct_) bridge_.wake();
}

redag::Time ReDAGExecutor::Core::expire_timers() {
  const std::lock_guard guard(expire_lock_);
  due_.clear();
  missed_.clear();
  const redag::Time next = timers_.expire_due(engine_->now(), due_, missed_);
  for (const redag::runtime::Release &release : missed_) {
    engine_->miss(release.task, release.nominal, redag::Reason::Overrun);
  }
  if (!due_.empty()) engine_->release(due_);
  return next;
}

void ReDAGExecutor::Core::time_releases() noexcept {
  while (!timer_exit_) {
    const redag::Time next = timing_ ? expire_timers() : kNever;
    if (next == kNever) {
      timer_parker_.park();
    } else if (next > engine_->now()) {
      timer_parker_.park_until(origin_ + next);
    }
  }
}

void ReDAGExecutor::Core::admit_noted() {
  std::vector<std::shared_ptr<Callback>> noted;
  {
    const std::lock_guard guard(noted_lock_);
    noted.swap(noted_);
  }
  for (const auto &callback : noted) callback->admit();
}

// For who pulls: everything that there is to do now becomes ready jobs.
void ReDAGExecutor::Core::admit(bool look_around) {
  begin_learning();
  if (learning_ && engine_->now() >= learn_until_) stop_learning();
  if (dirty_) collect();
  if (look_around && !bridge_.empty()) bridge_.wait(nanoseconds(0));
  expire_timers();
  admit_noted();
}

// ---- spinning ----

void ReDAGExecutor::Core::start() {
  begin_learning();
  if (mode_.mode == redag::PreemptionMode::Os && options_.raise_middleware) raise_middleware();
  if (started_) return;
  if (const redag::Result<void> ready = engine_->start(); !ready) throw std::runtime_error(to_string(ready.error()));
  redag::Result<void> timer_ready;
  redag::runtime::Event is_set_up;
  timer_thread_ = std::thread([&] {
    const int priority = mode_.mode == redag::PreemptionMode::Os ? band_.timer : 0;
    timer_ready = redag::runtime::set_up_this_thread({"redag-timer", priority, {}});
    const bool usable = timer_ready.has_value();
    is_set_up.set();
    if (usable) time_releases();
  });
  is_set_up.wait();
  if (!timer_ready) throw std::runtime_error(to_string(timer_ready.error()));
  started_ = true;
  RCLCPP_INFO(logger(), "%u workers, preemption %s%s%s", options_.workers, to_string(mode_.mode),
              mode_.reason.empty() ? "" : ", ", mode_.reason.c_str());
  {
    const std::lock_guard guard(records_lock_);
    for (const std::string &warning : warnings_) RCLCPP_WARN(logger(), "%s", warning.c_str());
  }
  if (matcher_) report_unmatched_at_ = engine_->now() + kNodesAppear;
}

// Tasks of the workload that are still without a callback when nodes and components should have been loaded.
void ReDAGExecutor::Core::report_unmatched() {
  report_unmatched_at_ = kNever;
  const std::lock_guard guard(collect_lock_);
  for (const std::string &line : matcher_->unmatched()) RCLCPP_WARN(logger(), "%s", line.c_str());
}

void ReDAGExecutor::Core::raise_middleware() {
  const auto refused = raise_middleware_threads(band_.timer);
  std::string warning;
  if (find_middleware_threads().empty()) {
    warning = "the middleware's threads are not known by name: give its receive threads a SCHED_FIFO priority above " +
              std::to_string(band_.top_job) + " yourself, or busy workers delay messages (docs/ros2.md)";
  } else if (!refused.empty()) {
    warning = fmt::format("{} threads of the middleware could not be raised above the workers", refused.size());
  }
  const std::lock_guard guard(records_lock_);
  if (!warning.empty() && std::find(warnings_.begin(), warnings_.end(), warning) == warnings_.end()) {
    warnings_.push_back(warning);
  }
}

void ReDAGExecutor::Core::spin() {
  start();
  const RaisedThread raised(mode_.mode == redag::PreemptionMode::Os ? band_.timer : 0);
  collect();
  direct_ = true;
  timing_ = true;
  timer_parker_.unpark();
  engine_->resume();
  try {
    while (host_.may_spin()) {
      if (dirty_) collect();
      admit_noted();
      const redag::Time now = engine_->now();
      if (learning_ && now >= learn_until_) stop_learning();
      if (now >= report_unmatched_at_) report_unmatched();
      const redag::Time next = std::min(report_unmatched_at_, learning_ ? learn_until_ : kNever);
      bridge_.wait(nanoseconds(next == kNever ? -1 : next - now));
    }
  } catch (...) {
    // The wait set failed, for instance because the context was shut down while it was filled.
    stop_workers();
    if (rclcpp::ok(context_)) throw;
    throw_failure();
    return;
  }
  stop_workers();
  throw_failure();
}

void ReDAGExecutor::Core::stop_workers() {
  timing_ = false;
  engine_->pause();
  (void)engine_->wait_paused(kNever);
  direct_ = false;
}

void ReDAGExecutor::Core::spin_ready(nanoseconds max_duration, bool exhaustive) {
  const redag::Time end = max_duration.count() == 0 ? kNever : engine_->now() + max_duration.count();
  bool again = true;
  while (again) {
    admit(true);
    again = false;
    while (host_.may_spin() && engine_->now() < end && run_one()) again = exhaustive;
  }
}

void ReDAGExecutor::Core::spin_one(nanoseconds timeout) {
  const redag::Time end = timeout.count() < 0 ? kNever : engine_->now() + timeout.count();
  admit(true);
  while (host_.may_spin() && !run_one()) {
    const redag::Time now = engine_->now();
    if (now >= end) return;
    waiting_ = true;
    bool idle = !dirty_;
    {
      const std::lock_guard guard(noted_lock_);
      idle = idle && noted_.empty();
    }
    const redag::Time next = std::min({end, timers_.next(), learning_ ? learn_until_ : kNever});
    if (idle) bridge_.wait(next == kNever ? nanoseconds(-1) : nanoseconds(std::max<redag::Duration>(0, next - now)));
    waiting_ = false;
    admit(false);
  }
}

bool ReDAGExecutor::Core::run_one() {
  const bool ran = engine_->run_one();
  throw_failure();
  return ran;
}

void ReDAGExecutor::Core::on_exception(const redag::runtime::Job &job, std::exception_ptr exception) {
  if (options_.on_exception) {
    ExceptionInfo info{"", exception};
    {
      const std::lock_guard guard(records_lock_);
      info.task = name_of(records_[job.task.value]);
    }
    if (options_.on_exception(info) == OnException::Continue) return;
  }
  {
    const std::lock_guard guard(records_lock_);
    if (!failure_) failure_ = std::move(exception);
  }
  host_.stop();
}

void ReDAGExecutor::Core::throw_failure() {
  std::exception_ptr failure;
  {
    const std::lock_guard guard(records_lock_);
    failure = std::exchange(failure_, nullptr);
  }
  if (failure) std::rethrow_exception(failure);
}

// ---- learning ----

void ReDAGExecutor::Core::begin_learning() {
  if (options_.learn.count() <= 0 || learn_until_ != kNever) return;
  learn_until_ = engine_->now() + options_.learn.count();
  learning_ = true;
}

void ReDAGExecutor::Core::stop_learning() {
  learning_ = false;
  const std::lock_guard collect_guard(collect_lock_);
  std::vector<std::pair<redag::TaskId, redag::Duration>> learned;
  {
    const std::lock_guard guard(records_lock_);
    for (std::size_t i = 0; i < records_.size(); ++i) {
      Record &record = records_[i];
      if (!record.callback || record.configured || record.callback->is_timer()) continue;
      const redag::Duration period = learned_period(record, 0);
      if (period > 0 && period != record.task.period) learned.emplace_back(redag::TaskId(i), period);
    }
    for (const auto &[task, period] : learned) {
      Record &record = records_[task.value];
      record.task.period = period;
      record.task.deadline = period;
      record.callback->set_deadline(period);
    }
  }
  for (const auto &[task, period] : learned) engine_->set_timing(task, period, period);
  RCLCPP_INFO(logger(), "learned the rates of %zu callbacks; they are frozen now", learned.size());
}

// The largest period among the tasks whose jobs publish what arrives here (as data tasks inherit it), or else the mean
// time between arrivals; 0: unknown. `depth` ends cycles.
redag::Duration ReDAGExecutor::Core::learned_period(const Record &record, int depth) const {
  constexpr int kDeepest = 32;
  if (record.configured || record.callback->is_timer()) return record.task.period;
  if (is_ros_internal(record.id)) return 0;  // loading nodes comes in bursts that say nothing of a rate
  redag::Duration period = 0;
  for (const redag::TaskId publisher : record.callback->publishers()) {
    if (depth >= kDeepest || publisher.value >= records_.size() || !records_[publisher.value].callback) continue;
    period = std::max(period, learned_period(records_[publisher.value], depth + 1));
  }
  return period > 0 ? period : record.callback->mean_interval();
}

// ---- what can be asked ----

std::string ReDAGExecutor::Core::name_of(const Record &record) const {
  if (record.configured) return dags_[record.dag].dag.name + "." + record.task.name;
  return to_string(record.id);
}

std::vector<std::string> ReDAGExecutor::Core::warnings() const {
  const std::lock_guard collect_guard(collect_lock_);
  const std::lock_guard guard(records_lock_);
  std::vector<std::string> all = warnings_;
  if (matcher_) {
    for (const std::string &line : matcher_->unmatched()) all.push_back(line);
  }
  return all;
}

std::vector<CallbackStats> ReDAGExecutor::Core::stats() const {
  std::vector<CallbackStats> result;
  std::vector<std::pair<redag::TaskId, std::shared_ptr<Callback>>> callbacks;
  {
    const std::lock_guard guard(records_lock_);
    for (std::size_t i = 0; i < records_.size(); ++i) {
      const Record &record = records_[i];
      if (!record.callback) continue;
      CallbackStats stats;
      stats.id = record.id;
      if (record.configured) stats.dag = dags_[record.dag].dag.name;
      stats.task = name_of(record);
      stats.period = record.task.period;
      stats.deadline = record.task.deadline;
      stats.wcet = record.configured ? record.task.wcet : 0;
      result.push_back(std::move(stats));
      callbacks.emplace_back(redag::TaskId(i), record.callback);
    }
  }
  for (std::size_t i = 0; i < result.size(); ++i) {
    CallbackStats &stats = result[i];
    const auto &[task, callback] = callbacks[i];
    stats.jobs = engine_->accounting(task);
    stats.misses = callback->late() + stats.jobs.skipped;
    stats.response_p50 = callback->response().percentile(0.5);
    stats.response_p99 = callback->response().percentile(0.99);
    stats.response_max = callback->response().longest();
    stats.execution_p50 = callback->execution().percentile(0.5);
    stats.execution_p99 = callback->execution().percentile(0.99);
    stats.execution_max = callback->execution().longest();
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const CallbackStats &a, const CallbackStats &b) { return a.period < b.period; });
  return result;
}

// DAG by DAG; tasks[i] are the ids of DAG i's tasks, in order. `with_edges`: data tasks follow what publishes to them.
Workload ReDAGExecutor::Core::as_workload(std::vector<std::vector<std::uint32_t>> &tasks, bool with_edges) const {
  Workload workload;
  workload.name = options_.workload ? options_.workload->name : "ros";
  workload.platform = redag::Platform{options_.workers, mode_.mode};
  workload.policy = options_.policy;
  std::set<std::string> names;
  for (std::uint32_t d = 0; d < dags_.size(); ++d) {
    redag::Dag dag = dags_[d].dag;
    std::vector<std::uint32_t> ids;
    for (std::uint32_t i = 0; i < records_.size(); ++i) {
      const Record &record = records_[i];
      if (record.dag != d || record.task.period == 0) continue;
      if (with_edges && (!record.callback || is_ros_internal(record.id))) continue;
      ids.push_back(i);
    }
    std::stable_sort(ids.begin(), ids.end(), [&](auto a, auto b) { return records_[a].rank < records_[b].rank; });
    for (const std::uint32_t i : ids) {
      const Record &record = records_[i];
      Task task = record.task;
      const std::string wanted = record.configured ? task.name : to_string(record.id);
      task.name = wanted;
      for (int n = 2; !names.insert(dag.name + "." + task.name).second; ++n)
        task.name = fmt::format("{}_{}", wanted, n);
      if (record.callback) {
        task.wcet = std::max(task.wcet, record.callback->execution().longest());
      }
      if (!with_edges) task.wcet = std::clamp<redag::Duration>(task.wcet, 1, task.deadline);
      task.bcet = std::min(task.bcet, task.wcet);
      task.execution = {};
      if (task.budget > 0) task.budget = std::max(task.budget, task.wcet);
      redag::Callback callback;
      callback.kind = record.id.kind;
      callback.node = record.id.node;
      callback.name = record.id.name;
      if (record.id.kind == Kind::Timer) callback.period = record.id.period;
      if (record.id.kind == Kind::Timer || record.id.kind == Kind::Waitable) callback.index = record.id.index;
      task.callback = callback;
      dag.tasks.push_back(std::move(task));
    }
    if (dag.tasks.empty()) continue;
    tasks.push_back(std::move(ids));
    workload.dags.push_back(std::move(dag));
  }
  return workload;
}

Workload ReDAGExecutor::Core::learned() const {
  const std::lock_guard guard(records_lock_);
  std::vector<std::vector<std::uint32_t>> ids;
  Workload workload = as_workload(ids, true);
  add_learned_edges(workload, ids);
  return workload;
}

// A message's task follows the task that publishes it. With several publishers it runs for each of them, which an
// AND-join cannot say: it stays a task with a rate of its own.
void ReDAGExecutor::Core::add_learned_edges(Workload &workload,
                                            const std::vector<std::vector<std::uint32_t>> &ids) const {
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    redag::Dag &dag = workload.dags[d];
    for (std::size_t t = 0; t < dag.tasks.size(); ++t) {
      const Record &record = records_[ids[d][t]];
      if (record.configured) {
        // As the file has it.
        const redag::Dag &configured = options_.workload->dags[record.dag];
        const auto same = std::find_if(configured.tasks.begin(), configured.tasks.end(),
                                       [&](const Task &task) { return task.name == record.task.name; });
        for (const std::uint32_t p : same->predecessors) {
          const auto named = std::find_if(dag.tasks.begin(), dag.tasks.end(),
                                          [&](const Task &task) { return task.name == configured.tasks[p].name; });
          if (named == dag.tasks.end()) continue;
          dag.tasks[t].predecessors.push_back(static_cast<std::uint32_t>(named - dag.tasks.begin()));
        }
        if (!dag.tasks[t].predecessors.empty()) dag.tasks[t].activation = same->activation;
        continue;
      }
      const auto publishers = record.callback->publishers();
      if (record.callback->is_timer() || publishers.size() != 1) continue;
      const auto position = std::find(ids[d].begin(), ids[d].end(), publishers.front().value);
      if (position == ids[d].end() || *position == ids[d][t]) continue;
      dag.tasks[t].predecessors = {static_cast<std::uint32_t>(position - ids[d].begin())};
      dag.tasks[t].activation = redag::Activation::Data;
    }
    break_cycles(dag);
    for (Task &task : dag.tasks) {
      if (task.activation == redag::Activation::Data) task.period = 0;  // inherited
    }
    redag::inherit_periods(dag);
  }
}

redag::trace::RunInfo ReDAGExecutor::Core::trace_info() const {
  redag::trace::RunInfo info;
  {
    const std::lock_guard guard(records_lock_);
    std::vector<std::vector<std::uint32_t>> ids;
    info.workload = as_workload(ids, false);
  }
  info.executor = "redag";
  info.config = engine_->options().config;
  info.preemption = to_string(mode_.mode);
  info.preemption_why = mode_.reason;
  info.driver = redag::trace::Driver::Ros;
  info.stepped = true;  // spinning begins and ends
  info.end = engine_->now();
  info.lost_events = engine_->lost_events();
  info.machine = redag::trace::this_machine();
  return info;
}

void ReDAGExecutor::Core::renumber(std::vector<JobEvent> &events) const {
  std::vector<std::uint32_t> position;
  {
    const std::lock_guard guard(records_lock_);
    position.assign(records_.size(), 0);
    std::vector<std::vector<std::uint32_t>> ids;
    (void)as_workload(ids, false);
    std::uint32_t next = 0;
    for (const auto &dag : ids) {
      for (const std::uint32_t id : dag) position[id] = next++;
    }
  }
  for (JobEvent &event : events) event.task = redag::TaskId(position.at(event.task.value));
}

}  // namespace redag_rclcpp
