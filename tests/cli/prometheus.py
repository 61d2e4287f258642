#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag export --prometheus`: what it answers, and a real Prometheus that scrapes it and is asked.

Usage: prometheus.py PROGRAM SOURCE_DIR. Ends with 77 and says so where there is no Prometheus; the tests that need none
have run then. Uses the standard library only.
"""
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.parse
import urllib.request

from program import PROGRAM, SOURCE, Case, main, redag

WAIT = 100  # seconds, for what takes one or two
DASHBOARD = SOURCE / "redag_lab" / "share" / "grafana" / "redag.json"
HAS_PROMETHEUS = all(map(shutil.which, ("prometheus", "promtool")))


def get(url):
    with urllib.request.urlopen(url, timeout=20) as answer:
        return answer.read().decode()


def samples(text):
    """Returns {(name, labels): value} of Prometheus's text format."""
    found = {}
    for line in text.splitlines():
        if line.startswith("#") or not line:
            continue
        name, labels, value = re.fullmatch(r"(\w+)(?:\{(.*)\})? (\S+)(?: \d+)?", line).groups()
        pairs = re.findall(r'(\w+)="((?:[^"\\]|\\.)*)"', labels or "")
        found[name, frozenset(pairs)] = float(value)
    return found


class Exporter(Case):
    def setUp(self):
        super().setUp()
        # A folder of our own: other executors may run on this machine. Links cannot leave /dev/shm.
        folder = tempfile.TemporaryDirectory(dir="/dev/shm")
        self.addCleanup(folder.cleanup)
        self.pages = pathlib.Path(folder.name)

    def start(self, *arguments, **options):
        process = subprocess.Popen(list(map(str, arguments)), text=True, **options)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process

    def eventually(self, what, answer):
        deadline = time.monotonic() + WAIT
        while time.monotonic() < deadline:
            result = answer()
            if result:
                return result
            time.sleep(0.1)
        return self.fail(what)

    def executor(self, workload=None):
        process = self.start(PROGRAM, "run", workload or self.cart, "--duration", "1h", "--json",
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        page = pathlib.Path(f"/dev/shm/redag.{process.pid}.0")
        self.eventually("no page", page.exists)
        os.link(page, self.pages / page.name)
        self.eventually("no jobs", lambda: redag("top", process.pid, "--json").returncode == 0 and all(
            task["finished"] > 3 for task in json.loads(redag("top", process.pid, "--json").stdout)["tasks"]))
        return process

    def exporter(self):
        process = self.start(PROGRAM, "export", "--prometheus", "--listen", "127.0.0.1:0", "--folder", self.pages,
                             stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        line = process.stderr.readline()
        return process, re.search(r"http://127\.0\.0\.1:\d+/metrics", line).group()

    def once(self):
        return self.expect(redag("export", "--prometheus", "--once", "--folder", self.pages), 0).stdout

    def test_the_figures_are_those_of_top(self):
        run = self.executor()
        _, url = self.exporter()
        before = json.loads(redag("top", run.pid, "--json").stdout)
        text = get(url)
        after = json.loads(redag("top", run.pid, "--json").stdout)
        found = samples(text)
        executor = {("executor", "cart"), ("pid", str(run.pid)), ("number", "0")}
        self.assertEqual(found["redag_executor_workers", frozenset(executor)], 1)
        self.assertEqual(found["redag_unreadable_pages", frozenset()], 0)
        for i, task in enumerate(after["tasks"]):
            labels = executor | {("dag", task["dag"]), ("task", task["name"])}

            def value(name, *more, labels=labels):
                return found[name, frozenset(labels | set(more))]

            def between(value, key, i=i):
                self.assertLessEqual(before["tasks"][i][key], value)
                self.assertGreaterEqual(after["tasks"][i][key], value)

            between(value("redag_jobs_released_total"), "released")
            between(value("redag_jobs_ended_total", ("outcome", "finished")), "finished")
            between(value("redag_deadline_misses_total"), "misses")
            between(round(value("redag_cpu_seconds_total") * 1e9), "cpu_ns")
            self.assertEqual(round(value("redag_deadline_seconds") * 1e9), task["deadline_ns"])
            self.assertEqual(value("redag_response_seconds_count"),
                             value("redag_jobs_ended_total", ("outcome", "finished")))
            buckets = sorted((float(dict(key[1])["le"]), count) for key, count in found.items()
                             if key[0] == "redag_response_seconds_bucket" and labels <= key[1])
            counts = [count for _, count in buckets]
            self.assertEqual(counts, sorted(counts), "they are cumulative")
            self.assertEqual(buckets[-1], (float("inf"), value("redag_response_seconds_count")))
            # The longest response lies in the last class that adds jobs, of at most half an octave.
            longest = value("redag_response_max_seconds")
            most = next(bound for bound, count in buckets if count == counts[-1])
            self.assertLessEqual(longest, most)
            self.assertGreater(longest, most / 1.6)

    def test_an_executor_that_ends_and_one_that_cannot_be_read(self):
        run = self.executor()
        self.assertIn("redag_executor_info", self.once())
        run.send_signal(signal.SIGINT)
        run.wait(timeout=WAIT)
        (self.pages / f"redag.{run.pid}.0").unlink(missing_ok=True)
        self.assertNotIn("redag_executor_info", self.once())
        (self.pages / "redag.1.0").write_bytes(b"nonsense")
        self.assertEqual(samples(self.once()), {("redag_unreadable_pages", frozenset()): 1})

    def test_it_ends_by_a_signal(self):
        process, _ = self.exporter()
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(timeout=WAIT), 0)

    def test_mistakes(self):
        self.expect(redag("export"), 2, "nothing to export to is named", "add --prometheus")
        for bad in ["nowhere", "1.2.3", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:80,443s", "[::1", "[]:80", ":80x",
                    "127.0.0.1:9 "]:
            self.expect(redag("export", "--prometheus", "--listen", bad), 2, "is no address to listen at", "127.0.0.1:9464")
        self.expect(redag("export", "--prometheus", "--folder", self.folder / "none"), 2, "is not a folder")
        self.expect(redag("export", "--listen", "1"), 2, "--prometheus")
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            self.expect(redag("export", "--prometheus", "--listen", port), 2, f"cannot listen at 127.0.0.1:{port}")

    def test_the_dashboard_asks_for_metrics_that_exist(self):
        self.executor()
        self.executor(SOURCE / "workloads" / "perception.yaml")  # has a device
        names = set(re.findall(r"\bredag_\w+", self.once()))
        dashboard = json.loads(DASHBOARD.read_text())
        for panel in dashboard["panels"]:
            for target in panel["targets"]:
                for name in re.findall(r"\bredag_\w+", target["expr"]):
                    # Neither has an end-to-end deadline.
                    if name != "redag_end_to_end_deadline_seconds":
                        self.assertIn(name, names, panel["title"])

    @unittest.skipUnless(HAS_PROMETHEUS, "no Prometheus")
    def test_promtool_finds_no_fault(self):
        self.executor()
        result = subprocess.run(["promtool", "check", "metrics"], input=self.once(), capture_output=True, text=True,
                                check=False)
        self.assertEqual((result.returncode, result.stdout + result.stderr), (0, ""))

    @unittest.skipUnless(HAS_PROMETHEUS, "no Prometheus")
    def test_a_prometheus_scrapes_and_answers(self):
        run = self.executor()
        _, url = self.exporter()
        target = urllib.parse.urlsplit(url).netloc
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        configuration = self.write("prometheus.yml", f"""\
global: {{scrape_interval: 1s}}
scrape_configs:
  - job_name: redag
    static_configs: [{{targets: ['{target}']}}]
""")
        with open(self.folder / "prometheus.log", "w") as log:
            self.start("prometheus", f"--config.file={configuration}", f"--storage.tsdb.path={self.folder / 'data'}",
                       f"--web.listen-address=127.0.0.1:{port}", stdout=log, stderr=log)

        def ask(query):
            try:
                answer = json.loads(get(f"http://127.0.0.1:{port}/api/v1/query?" + urllib.parse.urlencode({"query": query})))
            except OSError:
                return []  # it does not listen yet
            self.assertEqual(answer["status"], "success", query)
            return answer["data"]["result"]

        rate = 'rate(redag_jobs_ended_total{dag="fast",task="sense",outcome="finished"}[30s])'
        (jobs,) = self.eventually("Prometheus has no rate", lambda: ask(rate + " > 0"))
        self.assertEqual((jobs["metric"]["executor"], jobs["metric"]["pid"]), ("cart", str(run.pid)))
        for panel in json.loads(DASHBOARD.read_text())["panels"]:
            for one in panel["targets"]:
                query = one["expr"].replace("$executor", ".*").replace("$dag", ".*")
                query = query.replace("$__rate_interval", "30s").replace("$__range", "30s")
                result = self.eventually(panel["title"], lambda query=query: ask(f"count({query}) > 0") or
                                         "end_to_end_deadline" in query or "redag_device" in query or
                                         "bound" in query and ask(f"count({query})"))
                self.assertTrue(result)
        (p99,) = ask('histogram_quantile(0.99, sum by (le) (rate(redag_response_seconds_bucket{task="plan"}[30s])))')
        self.assertGreater(float(p99["value"][1]), 0.020)


if __name__ == "__main__":
    if "without Prometheus" in redag("export", "--prometheus", "--once").stderr:
        print("skipped: this redag was built without Prometheus (-DREDAG_PROMETHEUS=ON)")
        sys.exit(77)
    try:
        main()
    finally:
        if not HAS_PROMETHEUS and sys.exc_info()[1].code == 0:
            print("skipped in part: there is no Prometheus (tools/bootstrap observe)")
            sys.exit(77)
