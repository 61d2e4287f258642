#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag merge-traces`: two hosts with skewed clocks.

Usage: hosts.py PROGRAM SOURCE_DIR. Uses the standard library only.
"""
import gzip
import json
import re

from program import SANITIZED, SOURCE, Case, main, redag

TIMES = {"released", "ready", "dispatched", "started", "finished", "aborted"}  # kinds whose value is a time
DETECT_TO_BRAKE = "vision.camera.detect -> drive.avoid.obstacles -> drive.avoid.brake"
TRACKING = """\
Reference ID    : C0A80001 (base)
System time     : 0.000010000 seconds {way} of NTP time
Root delay      : 0.000080000 seconds
Root dispersion : 0.000020000 seconds
Leap status     : Normal
"""


class Hosts(Case):
    def setUp(self):
        super().setUp()
        self.results = {name: self.record(name) for name in ("vision", "drive")}

    def record(self, name):
        folder = self.folder / name
        self.expect(redag("simulate", SOURCE / "examples" / "hosts" / f"{name}.yaml", "--duration", "2s", "--events", "jsonl",
                          "--out", folder), 0)
        return folder

    def skew(self, name, offset, ppm=0.0, **run):
        """Lets a host have recorded with another clock; `run` changes what it says about itself."""
        file = self.results[name] / "events.jsonl"
        first, *events, last = file.read_text().splitlines()
        clock = lambda time: time + offset + int(time * ppm / 1e6)
        lines = []
        for line in events:
            event = json.loads(line)
            event[0] = clock(event[0])
            if event[1] in TIMES:
                event[5] = clock(event[5])
            lines.append(json.dumps(event, separators=(",", ":")))
        head, foot = json.loads(first), json.loads(last)
        head["run"].update(start_ns=clock(head["run"]["start_ns"]), end_ns=clock(head["run"]["end_ns"]), **run)
        foot["end_ns"] = clock(foot["end_ns"])
        file.write_text("\n".join([json.dumps(head, separators=(",", ":")), *lines, json.dumps(foot, separators=(",", ":"))]) + "\n")

    def merge(self, *arguments, out="merged", hosts=("vision", "drive")):
        named = [part for name in hosts for part in ("--host", f"{name}={self.results[name]}")]
        return redag("merge-traces", *named, *arguments, "--out", self.folder / out, "--force")

    def chain(self, *arguments):
        result = self.merge("--robot", SOURCE / "examples" / "hosts" / "robot.yaml", "--json", *arguments)
        (chain,) = self.document(result, "redag.hosts/1")["chains"]
        self.assertEqual(chain["name"], DETECT_TO_BRAKE)
        return chain

    def jobs(self, folder, name):
        rows = [line.split(",") for line in (self.folder / folder / "jobs.csv").read_text().splitlines()]
        at = {title: i for i, title in enumerate(rows[0])}
        return {int(row[at["job"]]): {key: int(row[at[key]]) for key in ("release_ns", "finish_ns") if row[at[key]]}
                for row in rows[1:] if f"{row[at['dag']]}.{row[at['task']]}" == name}

    def true_latencies(self):
        """The simulations share one true clock: from the release of `grab` to the end of `brake` of the same number."""
        grab, brake = self.jobs("vision", "camera.grab"), self.jobs("drive", "avoid.brake")
        return {n: job["finish_ns"] - grab[n]["release_ns"] for n, job in brake.items() if "finish_ns" in job}

    def test_skewed_clocks(self):
        true = self.true_latencies()
        self.skew("vision", 250_000_000)
        self.skew("drive", -3_000_000_000, ppm=20)
        offsets = ["--offset", "vision=250.01ms+-15us", "--offset", "drive=-3s+-10us@start", "--offset",
                   "drive=-2.99996s+-10us@end"]
        chain = self.chain(*offsets)
        self.assertEqual(chain["answers"], len(true))
        self.assertEqual(chain["answers"], chain["met"] + chain["missed"] + chain["unknown"])
        self.assertEqual((chain["ambiguous"], chain["unmatched"]), (0, 0))
        self.assertGreater(chain["unknown"], 0)
        self.assertGreater(chain["met"], 0)
        self.assertLessEqual(chain["widest_ns"], 51_000)
        for answer in chain["worst"]:
            self.assertLessEqual(answer["low_ns"], true[answer["job"]])
            self.assertLessEqual(true[answer["job"]], answer["high_ns"])
            if answer["verdict"] == "missed":
                self.assertGreater(true[answer["job"]], chain["deadline_ns"])
        self.assertLessEqual(chain["missed"], sum(latency > chain["deadline_ns"] for latency in true.values()))
        self.assertEqual(sorted(path.name for path in (self.folder / "merged").iterdir()),
                         ["events.redag", "hosts.json", "jobs.csv", "summary.json", "trace.pftrace"])

    def test_the_merged_result_is_one_run(self):
        self.skew("drive", 1_250_000)
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=1.25ms"), 0)
        merged = self.folder / "merged"
        self.assertEqual(self.jobs("merged", "vision/camera.detect"), self.jobs("vision", "camera.detect"))
        drive = {n: {key: time for key, time in job.items()} for n, job in self.jobs("drive", "avoid.brake").items()}
        self.assertEqual(self.jobs("merged", "drive/avoid.brake"), drive)
        self.assertIn("ok", self.expect(redag("check-trace", merged), 0).stdout)
        self.expect(redag("why", merged), 0)
        run = json.loads((merged / "summary.json").read_text())["run"]
        self.assertEqual(run["config"]["workers"], 2)
        self.assertIn("cluster: vision", run["workload"])
        self.assertLess(self.events_in(merged), self.events_in(self.results["vision"]) + self.events_in(self.results["drive"]) + 1)

    def events_in(self, folder):
        return len(redag("events", folder).stdout.splitlines()) - 2

    def test_the_report_shows_the_chains(self):
        self.skew("drive", 1_250_000)
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=1.25ms+-40us", "--robot",
                               SOURCE / "examples" / "hosts" / "robot.yaml"), 0)
        merged = self.folder / "merged"
        (group,) = json.loads(self.expect(redag("report", merged, "--json"), 0).stdout)["groups"]
        self.assertEqual([host["name"] for host in group["hosts"]["hosts"]], ["vision", "drive"])
        self.assertIn("answers missed their deadlines", group["headline"]["text"])
        self.assertIn(DETECT_TO_BRAKE, " ".join(sentence["text"] for sentence in group["verdict"]))
        # Of another run than the events beside it, and of another program.
        hosts = json.loads((merged / "hosts.json").read_text())
        hosts["provenance"]["created"] = "2001-01-01T00:00:00Z"
        (merged / "hosts.json").write_text(json.dumps(hosts))
        self.assertIsNone(json.loads(redag("report", merged, "--json").stdout)["groups"][0]["hosts"])
        (merged / "hosts.json").write_text('{"format":"redag.hosts/1","provenance":{}}')
        self.expect(redag("report", merged, "--json"), 2, "hosts.json:1:1: error: the file was not written by 'redag merge-traces'")

    def test_three_verdicts(self):
        latencies = self.true_latencies().values()
        late = sum(latency > 15_620_000 for latency in latencies)
        exact = self.chain("--offset", "vision=0", "--offset", "drive=0")
        self.assertEqual((exact["missed"], exact["unknown"]), (late, 0))
        self.assertGreater(late, 0)
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=0", "--check", "--link",
                               "vision.camera.detect,drive.avoid.obstacles,500us"), 1)
        vague = self.chain("--offset", "vision=0", "--offset", "drive=0+-2ms")
        self.assertEqual((vague["missed"], vague["met"], vague["unknown"]), (0, 0, len(latencies)))
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=0+-2ms", "--check", "--link",
                               "vision.camera.detect,drive.avoid.obstacles,500us"), 0)
        lost = self.chain("--offset", "vision=0", "--offset", "drive=5ms")
        self.assertEqual(lost["answers"], 0)
        self.assertGreater(lost["unmatched"], 50)

    def test_time_services(self):
        for name, way in ("vision", "fast"), ("drive", "slow"):
            self.write(f"{name}.txt", TRACKING.format(way=way))
        files = ["--clock", f"vision={self.folder / 'vision.txt'}", "--clock", f"drive={self.folder / 'drive.txt'}"]
        chain = self.chain(*files)
        self.assertEqual(chain["widest_ns"], 2 * (10_000 + 2 * (20_000 + 40_000)))
        self.assertEqual(chain["unmatched"], 0)
        self.write("drive.txt", "506 Cannot talk to daemon\n")
        self.expect(self.merge(*files), 2, "drive.txt:1:1: error: neither chrony nor linuxptp wrote this text", "chronyc tracking")

    def test_a_file_of_hosts(self):
        text = ("hosts:\n  - {name: vision, result: vision, offset: 0}\n  - {name: drive, result: drive, offset: 0+-40us}\n"
                "links:\n  - {from: vision.camera.detect, to: drive.avoid.obstacles, transport: 500us}\n")
        file = self.write("hosts.yaml", text)
        result = redag("merge-traces", file, "--out", self.folder / "merged", "--json")
        self.assertEqual(self.document(result, "redag.hosts/1")["chains"][0]["name"], DETECT_TO_BRAKE)
        for wrong, mistake in (("offset: 0+-40us", "offset: 0+--40us"), ("offset: 0+-40us", "offset: 40"), (", offset: 0+-40us", ""),
                               ("name: drive", "name: vision"), ("obstacles", "obstacle"), ("500us", "-5us")):
            self.write("hosts.yaml", text.replace(wrong, mistake))
            result = self.expect(redag("merge-traces", file, "--out", self.folder / "merged", "--force"), 2)
            self.assertRegex(result.stderr, r"hosts\.yaml:[35]:\d+: error: ", mistake)

    def tasks(self, name):
        """The tasks of a recorded host, as text."""
        head = json.loads((self.results[name] / "events.jsonl").read_text().partition("\n")[0])
        return head["run"]["workload"].partition("dags:")[2]

    def record_kernel(self, name, *rows):
        """Puts a record of the kernel beside a host's events."""
        head = json.loads((self.results[name] / "events.jsonl").read_text().partition("\n")[0])
        lines = [{"format": "redag.kernel/2", "provenance": head["provenance"]}, *rows, {"end": True}]
        with gzip.open(self.results[name] / "kernel.jsonl.gz", "wt") as file:
            file.writelines(json.dumps(line) + "\n" for line in lines)

    def test_records_of_the_kernel(self):
        """Each host's processors and threads have their own numbers, on the clock of all."""
        rows = [["process", 10, "robot"], ["thread", 10, "redag-0", 10], ["job", 0, 0, 10]]
        self.record_kernel("vision", *rows, ["switch", 1000, 1, 0, False, 10, 48])
        self.record_kernel("drive", *rows, ["thread", 20, "cc1plus-20", 0], ["switch", 60_000, 0, 10, True, 20, 120])
        self.skew("drive", 50_000)
        text = self.expect(self.merge("--offset", "vision=0", "--offset", "drive=50us+-80us"), 0).stdout
        self.assertIn("kernel.jsonl.gz", text)
        merged = self.folder / "merged"
        with gzip.open(merged / "kernel.jsonl.gz", "rt") as file:
            head, *lines, last = map(json.loads, file)
        self.assertEqual((head["format"], last), ("redag.kernel/2", {"end": True}))
        events = json.loads(self.expect(redag("events", merged), 0).stdout.partition("\n")[0])
        self.assertEqual(head["provenance"], events["provenance"])
        second = 1 << 22
        self.assertEqual([line for line in lines if line[0] != "job"],
                         [["process", 10, "vision/robot"], ["thread", 10, "redag-0", 10],
                          ["switch", 1000, 1, 0, False, 10, 48],
                          ["process", second + 10, "drive/robot"], ["thread", second + 10, "redag-0", second + 10],
                          ["thread", second + 20, "drive/cc1plus-20", 0],
                          ["switch", 10_000, 2, second + 10, True, second + 20, 120]])
        first = self.tasks("vision").count("- {name:")
        self.assertEqual([line for line in lines if line[0] == "job"], [["job", 0, 0, 10], ["job", first, 0, second + 10]])
        self.expect(redag("why", merged), 0)
        self.expect(redag("report", merged), 0)
        # A run without such records leaves none, and a damaged one is named.
        (self.results["drive"] / "kernel.jsonl.gz").write_text("nonsense")
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=50us+-80us"), 2, "drive/kernel.jsonl.gz:1")

    def test_bad_input(self):
        zero = ["--offset", "vision=0", "--offset", "drive=0"]
        for arguments, *said in (
                (["--offset", "vision=0"], "host 'drive': nothing says how far its clock is from the others", "write 0"),
                ([*zero, "--offset", "arm=1ms"], "--offset: there is no host 'arm'", "one of vision, drive"),
                ([*zero, "--host", f"drive={self.results['vision']}"], "two hosts are called 'drive'"),
                ([*zero, "--host", f"arm={self.results['vision']}", "--offset", "arm=0"], "host 'arm' has the result of another host"),
                (["--offset", "vision=0", "--offset", "drive=1ms+--2us"], "--offset: the uncertainty in '1ms+--2us' is negative"),
                ([*zero, "--rate", "drive=10ppm"], "host 'drive': an offset with a rate needs the instant"),
                ([*zero, "--rate", "drive=-1ppm"], "--rate: '-1ppm' is no bound on the rate of a clock"),
                ([*zero, "--uncertainty", "drive=-1us"], "--uncertainty: '-1us' is negative"),
                (["--offset", "vision=0", "--offset", "drive=10s"], "the hosts have no time in common", "check the offsets"),
                ([*zero, "--link", "vision.camera.detect,drive.avoid.obstacle,1ms"], "there is no task 'drive.avoid.obstacle'",
                 "did you mean 'drive.avoid.obstacles'?"),
                ([*zero, "--link", "vision.camera.detect,drive.avoid.brake,1ms"], "task 'drive.avoid.brake' has predecessors"),
                ([*zero, "--link", "drive.control.pid,drive.avoid.obstacles,1ms"], "it stays on one host"),
                ([*zero, "--link", "vision.camera.detect"], "--link: 'vision.camera.detect' is no link"),
                ([*zero, "--host", "arm"], "--host: 'arm' does not name a host"),
                ([*zero, "--clock", f"drive={self.folder / 'none.txt'}"], "none.txt: error: cannot open"),
                ([*zero, "--robot", self.cart], "cart.yaml:1:1: error: --robot: the file is no robot file"),
                ([*zero, "--robot", SOURCE / "examples" / "robot" / "cart.yaml"], "no link of the robot joins two of the hosts"),
        ):
            self.expect(self.merge(*arguments), 2, *said)
            self.assertFalse((self.folder / "merged").exists(), arguments)
        self.expect(self.merge("--offset", "vision=0", hosts=["vision"]), 2, "there is one host, and merging takes at least two")
        self.expect(self.merge(*zero, "--host", f"arm={self.folder / 'none'}", "--offset", "arm=0"), 2, "none")

    def test_runs_of_different_kinds(self):
        self.skew("drive", 0, executor="mte", preemption="none")
        result = self.expect(self.merge("--offset", "vision=0", "--offset", "drive=0"), 2)
        self.assertIn("the executor is 'mte', and that of host 'vision' is 'redag'", result.stderr)
        self.assertIn("the preemption is 'none'", result.stderr)
        self.skew("drive", 0, executor="redag", preemption=json.loads(
            (self.results["vision"] / "events.jsonl").read_text().splitlines()[0])["run"]["preemption"],
            clock={"at_ns": 0, "system_ns": 1_000_000_000, "error_ns": 50})
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=0"), 2, "it does not state the time of the system's clock")

    def test_real_runs_state_the_clock(self):
        if SANITIZED:
            self.skipTest("the clock does not depend on what sanitizers look for")
        for name in "vision", "drive":
            folder = self.results[name] = self.folder / f"{name}-threads"
            self.expect(redag("run", SOURCE / "examples" / "hosts" / f"{name}.yaml", "--preemption", "none", "--duration", "300ms",
                              "--out", folder), 0)
        # One after the other, by the system's clock of one machine.
        self.expect(self.merge("--offset", "vision=0", "--offset", "drive=0"), 2, "the hosts have no time in common")
        text = redag("events", self.results["vision"]).stdout.splitlines()[0]
        clock = json.loads(text)["run"]["clock"]
        self.assertLess(clock["error_ns"], 1_000_000_000)
        self.assertTrue(re.fullmatch(r"1\d{18}", str(clock["system_ns"])))


if __name__ == "__main__":
    main()
