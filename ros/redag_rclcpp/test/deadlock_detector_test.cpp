// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests DeadlockDetector in virtual time, with an executor that is only described.
#include "watch/deadlock_detector.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace redag_rclcpp {
namespace {

using redag::Duration;
using redag::JobSlot;
using redag::kMillisecond;
using redag::kNever;
using redag::kSecond;
using redag::TaskId;
using redag::Time;
using redag::runtime::StartedJob;
using Side = Exchange::Side;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

/// An executor with started jobs and kept inputs. A job is in slot N of thread N unless it is nested.
class Robot : public DeadlockView {
 public:
  explicit Robot(std::uint32_t workers) : workers_(workers) {}

  [[nodiscard]] std::uint32_t workers() const override { return workers_; }
  [[nodiscard]] CallbackPlace place_of(TaskId task) const override { return places_.at(task.value); }
  [[nodiscard]] std::vector<Endpoint> endpoints() const override { return endpoints_; }
  [[nodiscard]] ThreadWait wait_of(int thread_id) const override { return waits.at(thread_id); }

  /// A job of callback "NODE.NAME" that begins now, on a thread of its own, and waits for a future.
  std::size_t start(const std::string &node, const std::string &name, const std::string &group) {
    places_.push_back(place(node, name, group));
    const auto index = static_cast<std::uint32_t>(jobs.size());
    StartedJob job;
    job.job.task = TaskId(places_.size() - 1);
    job.job.number = 7;
    job.job.slot = JobSlot(index);
    job.thread = index;
    job.on_top = true;
    job.begun = now;
    job.thread_id = static_cast<int>(index);
    jobs.push_back(job);
    waits[job.thread_id] = ThreadWait::Future;
    return index;
  }
  /// The last job started is suspended under the next one, on the same thread.
  void nest() { jobs.back().on_top = false; }

  Endpoint &client(const std::string &node, const std::string &service, const std::string &group) {
    return add(node, Side::Client, service, group);
  }
  Endpoint &server(const std::string &node, const std::string &service, const std::string &group) {
    return add(node, Side::Server, service, group);
  }
  void arrives(Endpoint &endpoint, JobSlot sender = JobSlot()) { endpoint.kept.push_back({now, sender}); }
  void limit_dag(std::uint32_t max_active) {
    for (CallbackPlace &place : places_) place.max_active = max_active;
    for (Endpoint &endpoint : endpoints_) endpoint.place.max_active = max_active;
  }

  /// Looks at the detector's interval for that long. Returns what began.
  std::vector<Deadlock> pass(Duration duration, Duration cpu_per_look = 0) {
    std::vector<Deadlock> begun;
    for (const Time end = now + duration; now < end;) {
      now += DeadlockDetector::kInterval;
      for (StartedJob &job : jobs) job.thread_cpu += cpu_per_look;
      detector_.look(now, jobs, *this, begun, ended);
    }
    return begun;
  }

  Time now = kSecond;
  std::vector<StartedJob> jobs;
  std::map<int, ThreadWait> waits;
  std::vector<Deadlock> ended;

 private:
  static CallbackPlace place(const std::string &node, const std::string &name, const std::string &group) {
    CallbackPlace place;
    place.name = node + "." + name;
    place.node = node;
    place.group = group;
    place.group_text = "group " + group;
    place.dag_name = "d";
    return place;
  }
  Endpoint &add(const std::string &node, Side side, const std::string &service, const std::string &group) {
    endpoints_.reserve(16);  // the tests keep references
    Endpoint endpoint;
    endpoint.place = place(node, side == Side::Client ? "client" : "server", group);
    endpoint.exchange = {.side = side, .name = service};
    return endpoints_.emplace_back(endpoint);
  }

  const std::uint32_t workers_;
  std::vector<CallbackPlace> places_;
  std::vector<Endpoint> endpoints_;
  DeadlockDetector detector_;
};

/// A job that waits in the group of its client, whose response has arrived.
void wait_in_own_group(Robot &robot) {
  Endpoint &client = robot.client("/n", "/map", "g0");
  robot.start("/n", "timer", "g0");
  robot.arrives(client);
}

TEST(DeadlockDetector, NamesACallbackThatHoldsTheGroupOfItsClient) {
  Robot robot(2);
  wait_in_own_group(robot);
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1)) << "within a second, and once";
  EXPECT_EQ(found[0].waiting, "/n.timer");
  EXPECT_EQ(found[0].blocked, "/n.client");
  EXPECT_EQ(found[0].resource, "group g0");
  EXPECT_TRUE(found[0].certain);
  EXPECT_EQ(found[0].ended, kNever);
  EXPECT_THAT(found[0].text,
              AllOf(HasSubstr("/n.timer waits for a response that cannot reach it: the response for /n.client arrived"),
                    HasSubstr("while /n.timer holds group g0"),
                    HasSubstr("Create the client in a callback group of "
                              "its own, or do not wait in the callback")));
  EXPECT_THAT(robot.pass(20 * kSecond), IsEmpty());
  EXPECT_THAT(robot.ended, IsEmpty());
}

TEST(DeadlockDetector, SaysWhenItHasEnded) {
  Robot robot(2);
  wait_in_own_group(robot);
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1));
  robot.jobs.clear();
  EXPECT_THAT(robot.pass(kSecond), IsEmpty());
  ASSERT_THAT(robot.ended, SizeIs(1));
  EXPECT_EQ(robot.ended[0].begun, found[0].begun);
  EXPECT_GT(robot.ended[0].ended, found[0].begun);
  EXPECT_LE(robot.ended[0].ended, found[0].begun + kSecond);

  wait_in_own_group(robot);
  robot.jobs.back().job.number = 8;
  EXPECT_THAT(robot.pass(kSecond), SizeIs(1)) << "the next one is reported again";
}

TEST(DeadlockDetector, EndsWhenTheInputIsTaken) {
  Robot robot(2);
  Endpoint &client = robot.client("/n", "/map", "g0");
  robot.start("/n", "timer", "g0");
  robot.arrives(client);
  ASSERT_THAT(robot.pass(kSecond), SizeIs(1));
  client.kept.clear();
  EXPECT_THAT(robot.pass(kSecond), IsEmpty());
  EXPECT_THAT(robot.ended, SizeIs(1));
}

TEST(DeadlockDetector, IgnoresAJobThatComputes) {
  Robot robot(2);
  wait_in_own_group(robot);
  EXPECT_THAT(robot.pass(30 * kSecond, 20 * kMillisecond), IsEmpty());
}

TEST(DeadlockDetector, IgnoresAJobThatCouldRun) {
  Robot robot(2);
  wait_in_own_group(robot);
  robot.waits[0] = ThreadWait::None;  // more urgent threads leave it no processor
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, NamesAJobThatPollsItsFuture) {
  Robot robot(2);
  wait_in_own_group(robot);
  EXPECT_THAT(robot.pass(kSecond, 400 * redag::kMicrosecond), SizeIs(1));
}

TEST(DeadlockDetector, IgnoresAJobWhoseResponseHasNotArrived) {
  Robot robot(2);
  robot.client("/n", "/map", "g0");
  robot.start("/n", "timer", "g0");
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, IgnoresAResponseThatCameBeforeTheJob) {
  Robot robot(2);
  robot.arrives(robot.client("/n", "/map", "g0"));
  robot.now += kMillisecond;
  robot.start("/n", "timer", "g0");
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, IgnoresAResponseThatAFreeWorkerWillTake) {
  Robot robot(2);
  Endpoint &client = robot.client("/n", "/map", "g1");
  robot.start("/n", "timer", "g0");
  robot.arrives(client);
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, WaitsLongerIfTheJobDoesNotWaitForAFuture) {
  Robot robot(2);
  wait_in_own_group(robot);
  robot.waits[0] = ThreadWait::Other;
  EXPECT_THAT(robot.pass(9 * kSecond), IsEmpty());
  const std::vector<Deadlock> found = robot.pass(2 * kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_FALSE(found[0].certain);
  EXPECT_THAT(found[0].text, HasSubstr("/n.timer may wait for a response"));
}

TEST(DeadlockDetector, WaitsLongerIfAnotherClientCouldStillAnswer) {
  Robot robot(2);
  wait_in_own_group(robot);
  robot.client("/n", "/slow", "g1");
  EXPECT_THAT(robot.pass(9 * kSecond), IsEmpty());
  const std::vector<Deadlock> found = robot.pass(2 * kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_FALSE(found[0].certain);
}

TEST(DeadlockDetector, AClientThatCannotAnswerEitherIsNoAlternative) {
  Robot robot(2);
  wait_in_own_group(robot);
  robot.client("/n", "/slow", "g0");
  robot.client("/other", "/slow", "g1");
  EXPECT_THAT(robot.pass(kSecond), SizeIs(1));
}

// ---- workers that are lent ----

TEST(DeadlockDetector, NamesAJobThatHasLentItsWorkerAndHoldsTheGroup) {
  Robot robot(1);
  wait_in_own_group(robot);
  robot.jobs.back().lends = true;
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_TRUE(found[0].certain);
  EXPECT_EQ(found[0].resource, "group g0");
}

TEST(DeadlockDetector, AWorkerThatIsLentCanTakeTheResponse) {
  Robot robot(1);
  Endpoint &client = robot.client("/n", "/map", "g1");
  robot.start("/n", "timer", "g0");
  robot.jobs.back().lends = true;
  robot.arrives(client);
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

// ---- no worker ----

TEST(DeadlockDetector, NamesACallbackThatHasTheOnlyWorker) {
  Robot robot(1);
  Endpoint &client = robot.client("/n", "/map", "");
  robot.start("/n", "timer", "");
  robot.arrives(client);
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].resource, "the only worker");
  EXPECT_THAT(found[0].text, AllOf(HasSubstr("because the only worker has a callback that waits (/n.timer)"),
                                   HasSubstr("parameter 'workers'")));
}

TEST(DeadlockDetector, NamesAllCallbacksThatHaveTheWorkers) {
  Robot robot(2);
  Endpoint &first = robot.client("/a", "/map", "g1");
  Endpoint &second = robot.client("/b", "/map", "g3");
  robot.start("/a", "timer", "g0");
  robot.start("/b", "timer", "g2");
  robot.arrives(first);
  EXPECT_THAT(robot.pass(5 * kSecond), IsEmpty()) << "the other response can still come, but reaches nobody";
  robot.arrives(second);
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].waiting, "/a.timer");
  EXPECT_EQ(found[1].waiting, "/b.timer");
  EXPECT_EQ(found[1].blocked, "/b.client");
  EXPECT_EQ(found[1].resource, "any of the 2 workers");
  EXPECT_THAT(found[0].text, HasSubstr("because all 2 workers have callbacks that wait (/a.timer, /b.timer)"));
}

TEST(DeadlockDetector, IgnoresJobsWhileOneWorkerIsBusy) {
  Robot robot(2);
  Endpoint &client = robot.client("/a", "/map", "g1");
  robot.start("/a", "timer", "g0");
  robot.start("/b", "planner", "g2");
  robot.waits[1] = ThreadWait::None;
  robot.arrives(client);
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, IsUncertainAboutResponsesForOtherNodes) {
  Robot robot(1);
  Endpoint &client = robot.client("/b", "/map", "g1");
  robot.start("/a", "timer", "g0");
  robot.arrives(client);
  EXPECT_THAT(robot.pass(9 * kSecond), IsEmpty());
  EXPECT_THAT(robot.pass(2 * kSecond), SizeIs(1));
}

TEST(DeadlockDetector, NamesACallbackThatTakesThePlacesOfItsDag) {
  Robot robot(4);
  Endpoint &client = robot.client("/n", "/map", "g1");
  robot.start("/n", "timer", "g0");
  robot.arrives(client);
  robot.limit_dag(1);
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].resource, "a place in DAG d (max_active 1)");
  EXPECT_THAT(found[0].text, HasSubstr("Raise max_active of DAG d"));
}

// ---- services of the same executor ----

TEST(DeadlockDetector, NamesAServiceWhoseGroupTheCallerHolds) {
  Robot robot(3);
  robot.client("/n", "/map", "g1");
  Endpoint &server = robot.server("/n", "/map", "g0");
  const std::size_t job = robot.start("/n", "timer", "g0");
  robot.arrives(server, JobSlot(job));
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].blocked, "/n.server");
  EXPECT_THAT(found[0].text, AllOf(HasSubstr("a response that cannot come: its request reached /n.server"),
                                   HasSubstr("Create the service and the client in callback groups of their own")));
}

TEST(DeadlockDetector, FindsTheCallerByItsClientIfAThreadOfTheMiddlewareBroughtTheRequest) {
  Robot robot(3);
  robot.client("/n", "/map", "g1");
  Endpoint &server = robot.server("/n", "/map", "g0");
  robot.start("/n", "timer", "g0");
  robot.arrives(server);
  EXPECT_THAT(robot.pass(kSecond), SizeIs(1));
}

TEST(DeadlockDetector, IgnoresACallerWhoseServiceWaitsForSomethingThatCanCome) {
  Robot robot(3);
  robot.client("/n", "/map", "g1");
  Endpoint &server = robot.server("/m", "/map", "g2");
  const std::size_t caller = robot.start("/n", "timer", "g0");
  robot.start("/m", "timer", "g2");
  robot.arrives(server, JobSlot(caller));
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, NamesBothCallbacksThatWaitForEachOther) {
  Robot robot(3);
  Endpoint &a = robot.server("/a", "/a", "ga");
  Endpoint &b = robot.server("/b", "/b", "gb");
  const std::size_t first = robot.start("/a", "timer", "ga");
  const std::size_t second = robot.start("/b", "timer", "gb");
  robot.arrives(b, JobSlot(first));
  EXPECT_THAT(robot.pass(5 * kSecond), IsEmpty()) << "the second one may wait for something else";
  robot.arrives(a, JobSlot(second));
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].waiting, "/a.timer");
  EXPECT_EQ(found[0].blocked, "/b.server");
  EXPECT_EQ(found[0].resource, "group gb");
  EXPECT_THAT(found[0].text, HasSubstr("while /b.timer holds group gb"));
  EXPECT_EQ(found[1].waiting, "/b.timer");
  EXPECT_EQ(found[1].blocked, "/a.server");
}

TEST(DeadlockDetector, IgnoresTheRequestOfAnotherJob) {
  Robot robot(3);
  Endpoint &server = robot.server("/n", "/map", "g0");
  robot.client("/n", "/map", "g0");
  robot.start("/n", "timer", "g0");
  robot.start("/n", "caller", "g1");
  robot.waits[1] = ThreadWait::None;
  robot.arrives(server, JobSlot(std::size_t{1}));
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty());
}

TEST(DeadlockDetector, IgnoresTheRequestOfAnotherProcess) {
  Robot robot(2);
  Endpoint &server = robot.server("/n", "/plan", "g0");
  robot.client("/n", "/map", "g1");
  robot.start("/n", "timer", "g0");
  robot.arrives(server);
  EXPECT_THAT(robot.pass(30 * kSecond), IsEmpty()) << "no client of the node calls it";
}

// ---- cooperative ----

TEST(DeadlockDetector, NamesTheJobOnTopOfTheOneThatHoldsTheGroup) {
  Robot robot(2);
  Endpoint &client = robot.client("/n", "/map", "g0");
  robot.start("/n", "planner", "g0");
  robot.nest();
  robot.start("/n", "timer", "g1");
  robot.jobs[1].thread = robot.jobs[0].thread;
  robot.arrives(client);
  const std::vector<Deadlock> found = robot.pass(kSecond);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].waiting, "/n.timer");
  EXPECT_THAT(found[0].text, HasSubstr("while /n.planner holds group g0"));
}

}  // namespace
}  // namespace redag_rclcpp
