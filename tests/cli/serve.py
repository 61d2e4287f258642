#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Tests `redag serve` by HTTP: who is answered, with what, and how it ends.

Usage: serve.py PROGRAM SOURCE_DIR. Uses the standard library only. tests/report/live.mjs looks at the page in a browser.
"""
import http.client
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import unittest

from program import PROGRAM, SOURCE, Case, main, redag

DASHBOARD = SOURCE / "redag_lab" / "share" / "grafana" / "redag.json"


def samples(text):
    """Returns {(name, labels): value} of Prometheus's text format."""
    found = {}
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        name, labels, value = re.fullmatch(r"(\w+)(?:\{(.*)\})? (\S+)", line).groups()
        pairs = re.findall(r'(\w+)="((?:[^"\\]|\\.)*)"', labels or "")
        found[name, frozenset(pairs)] = float(value)
    return found


class Serve(Case):
    """Pages are linked into a folder of the test's own: other executors may run on this machine."""

    def setUp(self):
        super().setUp()
        directory = tempfile.TemporaryDirectory(dir="/dev/shm")  # links to pages cannot leave it
        self.addCleanup(directory.cleanup)
        self.pages = pathlib.Path(directory.name)
        self.server = subprocess.Popen([PROGRAM, "serve", "--port", "0", "--interval", "50ms", "--folder", self.pages],
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(self.server.communicate)
        self.addCleanup(self.server.kill)
        address = self.server.stdout.readline().strip()
        match = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/\?token=([0-9a-f]{64})", address)
        self.assertTrue(match, address)
        self.port, self.token = int(match[1]), match[2]

    def run_executor(self, workload=None):
        process = subprocess.Popen([PROGRAM, "run", workload or self.cart, "--duration", "1h", "--json"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        page = pathlib.Path(f"/dev/shm/redag.{process.pid}.0")
        while redag("top", process.pid, "--json").returncode != 0:
            self.assertIsNone(process.poll())
        os.link(page, self.pages / page.name)
        return process

    def ask(self, path="/", method="GET", token=True, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=100)
        self.addCleanup(connection.close)
        if token:
            headers.setdefault("Authorization", f"Bearer {self.token}")
        connection.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        return connection.getresponse()

    def events(self, path="/events"):
        response = self.ask(path)
        self.assertEqual(response.status, 200)
        self.assertEqual(response.headers["Content-Type"], "text/event-stream")
        while line := response.readline():
            if line.startswith(b"data: "):
                yield json.loads(line[6:])

    def first(self, is_wanted, path="/events"):
        return next(event for event in self.events(path) if is_wanted(event))

    def test_without_the_token_there_is_nothing(self):
        for path in ("/", "/live.js", "/style.css", "/events", "/metrics", "/nothing", "/?token=", "/?token=" + "0" * 64,
                     "/events?token=" + self.token, "/live.js?token=" + self.token):
            response = self.ask(path, token=False)
            self.assertEqual(response.status, 403, path)
            self.assertNotIn(self.token.encode(), response.read())
            self.assertIsNone(response.headers["Set-Cookie"])
        self.assertEqual(self.ask("/", token=False, Authorization="Bearer " + "0" * 64).status, 403)
        self.assertEqual(self.ask("/", token=False, Cookie=f"redag-{self.port}={'0' * 64}").status, 403)

    def test_the_address_gives_a_cookie_and_goes(self):
        response = self.ask("/?token=" + self.token, token=False)
        self.assertEqual(response.status, 303)
        self.assertEqual(response.headers["Location"], "/")
        cookie = response.headers["Set-Cookie"]
        self.assertIn("HttpOnly", cookie)
        self.assertIn("SameSite=Strict", cookie)
        page = self.ask("/", token=False, Cookie="a=b; " + cookie.split(";")[0])
        self.assertEqual(page.status, 200)
        self.assertIn(b"<main", page.read())

    def test_other_names_and_methods_are_refused(self):
        for host in ("evil.example", f"evil.example:{self.port}", "127.0.0.1", f"127.0.0.1.evil.example:{self.port}"):
            self.assertEqual(self.ask(Host=host).status, 421, host)
        self.assertEqual(self.ask(Host=f"localhost:{self.port}").status, 200)
        for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
            self.assertEqual(self.ask(method=method).status, 405, method)
        with socket.create_connection(("127.0.0.1", self.port), timeout=100) as connection:
            connection.sendall(f"GET / HTTP/1.1\r\nAuthorization: Bearer {self.token}\r\n\r\n".encode())
            self.assertIn(b" 421 ", connection.recv(100))

    def test_every_answer_restricts_the_browser(self):
        for path, status in (("/", 200), ("/live.js", 200), ("/nothing", 404), ("/?token=x", 200)):
            response = self.ask(path)
            self.assertEqual(response.status, status, path)
            policy = response.headers["Content-Security-Policy"]
            self.assertIn("default-src 'none'", policy)
            self.assertIn("script-src 'self';", policy)
            self.assertIn("frame-ancestors 'none'", policy)
            self.assertEqual(response.headers["X-Content-Type-Options"], "nosniff")
            self.assertEqual(response.headers["Referrer-Policy"], "no-referrer")
            self.assertEqual(response.headers["Cache-Control"], "no-store")
            body = response.read().decode()
            if status == 200 and path != "/live.js":
                self.assertNotRegex(body, r"<script>|\son\w+=|<style")
        self.assertEqual(self.ask("/", token=False).headers["X-Frame-Options"], "DENY")

    def test_only_this_machine_is_answered(self):
        listening = {line.split()[1] for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:]
                     if line.split()[3] == "0A"}
        self.assertIn(f"0100007F:{self.port:04X}", listening)
        self.assertNotIn(f"00000000:{self.port:04X}", listening)

    def test_states_follow_the_executors(self):
        self.assertIsNone(self.first(lambda event: True)["frame"])
        first = self.run_executor()
        event = self.first(lambda event: event["frame"])
        self.assertEqual(event["frame"]["format"], "redag.live/1")
        self.assertEqual(event["frame"]["pid"], first.pid)
        second = self.run_executor()
        event = self.first(lambda event: len(event["list"]["executors"]) == 2, f"/events?executor={second.pid}")
        self.assertEqual(event["frame"]["pid"], second.pid)
        self.assertEqual({executor["pid"] for executor in event["list"]["executors"]}, {first.pid, second.pid})
        # Once it has been killed, the other one of the same name takes its place; after that there is none.
        stream = self.events(f"/events?executor={second.pid}")
        self.assertEqual(next(stream)["frame"]["pid"], second.pid)
        second.kill()
        second.wait()
        self.assertEqual(next(event for event in stream if len(event["list"]["executors"]) == 1)["frame"]["pid"], first.pid)
        first.kill()
        first.wait()
        self.assertEqual(next(event for event in stream if event["frame"] is None)["list"]["executors"], [])
        self.assertEqual(self.ask("/events?executor=x").status, 400)

    def metrics(self):
        response = self.ask("/metrics")
        self.assertEqual(response.status, 200)
        self.assertEqual(response.headers["Content-Type"], "text/plain; version=0.0.4; charset=utf-8")
        return response.read().decode()

    def test_metrics_are_the_figures_of_top(self):
        self.assertEqual(samples(self.metrics()), {("redag_unreadable_pages", frozenset()): 0})
        run = self.run_executor()
        while not all(task["finished"] > 3 for task in json.loads(redag("top", run.pid, "--json").stdout)["tasks"]):
            self.assertIsNone(run.poll())
        before = json.loads(redag("top", run.pid, "--json").stdout)
        found = samples(self.metrics())
        after = json.loads(redag("top", run.pid, "--json").stdout)
        executor = {("executor", "cart"), ("pid", str(run.pid)), ("number", "0")}
        self.assertEqual(found["redag_executor_workers", frozenset(executor)], 1)
        for i, task in enumerate(after["tasks"]):
            labels = executor | {("dag", task["dag"]), ("task", task["name"])}

            def value(name, *more, labels=labels):
                return found[name, frozenset(labels | set(more))]

            for metric, key in [(value("redag_jobs_released_total"), "released"),
                                (value("redag_jobs_ended_total", ("outcome", "finished")), "finished"),
                                (value("redag_deadline_misses_total"), "misses"),
                                (round(value("redag_cpu_seconds_total") * 1e9), "cpu_ns")]:
                self.assertLessEqual(before["tasks"][i][key], metric)
                self.assertGreaterEqual(after["tasks"][i][key], metric)
            self.assertEqual(round(value("redag_deadline_seconds") * 1e9), task["deadline_ns"])
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

    def test_metrics_have_one_block_each(self):
        self.run_executor()
        self.run_executor()
        (self.pages / "redag.1.0").write_bytes(b"nonsense")
        text = self.metrics()
        self.assertIn("\nredag_unreadable_pages 1\n", text)
        names = [line.split()[2] for line in text.splitlines() if line.startswith("# TYPE")]
        self.assertEqual(len(names), len(set(names)))
        blocks = re.split(r"^# HELP ", text, flags=re.M)[1:]
        for name, block in zip(names, blocks, strict=True):
            for line in block.splitlines()[2:]:
                self.assertRegex(line, rf"^{name}(_bucket|_count|_sum)?(\{{| )")

    def test_the_dashboard_asks_for_metrics_that_exist(self):
        self.run_executor()
        self.run_executor(SOURCE / "workloads" / "perception.yaml")  # has a device
        names = set(re.findall(r"\bredag_\w+", self.metrics()))
        for panel in json.loads(DASHBOARD.read_text())["panels"]:
            for target in panel["targets"]:
                for name in re.findall(r"\bredag_\w+", target["expr"]):
                    # Neither has an end-to-end deadline.
                    if name != "redag_end_to_end_deadline_seconds":
                        self.assertIn(name, names, panel["title"])

    @unittest.skipUnless(shutil.which("promtool"), "promtool is not installed")
    def test_promtool_finds_no_fault(self):
        self.run_executor()
        result = subprocess.run(["promtool", "check", "metrics"], input=self.metrics(), capture_output=True, text=True,
                                check=False)
        self.assertEqual((result.returncode, result.stdout + result.stderr), (0, ""))

    def test_a_token_that_other_programs_know(self):
        token = self.write("token", "0123456789abcdef" * 2 + "\n")
        token.chmod(0o600)
        with subprocess.Popen([PROGRAM, "serve", "--port", "0", "--token-file", token, "--folder", self.pages],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
            match = re.search(r":(\d+)/\?token=(\w+)", server.stdout.readline())
            self.assertEqual(match[2], token.read_text().strip())
            self.port, self.token = int(match[1]), match[2]
            self.assertIn("redag_unreadable_pages 0", self.metrics())
            self.assertEqual(self.ask("/metrics", token=False).status, 403)
            server.kill()
        token.chmod(0o644)
        self.expect(redag("serve", "--token-file", token), 2, "every user of this machine can read the token", "chmod 600")
        self.expect(redag("serve", "--token-file", self.folder / "none"), 2, "cannot be read", "openssl rand")

    def test_only_so_many_watch_at_a_time(self):
        streams = [self.events() for _ in range(8)]
        for stream in streams:
            next(stream)
        self.assertEqual(self.ask("/events").status, 503)
        self.assertEqual(self.ask("/").status, 200, "the page is still there")
        streams.pop().close()

    def test_it_ends_cleanly(self):
        stream = self.events()
        next(stream)
        self.server.send_signal(signal.SIGINT)
        self.assertEqual(self.server.wait(timeout=100), 0)
        for _ in stream:
            pass  # ends

    def test_a_port_in_use_is_said(self):
        result = redag("serve", "--port", self.port)
        self.expect(result, 2, f"port {self.port}", "--port 0")
        self.expect(redag("serve", "--port", "65536"), 2, "65535")
        self.expect(redag("serve", "--folder", "/nowhere"), 2, "not a folder")

    def test_nonsense_does_not_end_it(self):
        for text in (b"\r\n\r\n", b"GET\r\n\r\n", os.urandom(5000), b"GET /" + b"x" * 20000 + b" HTTP/1.1\r\n\r\n",
                     b"GET / HTTP/1.1\r\nHost: " + b"y" * 20000 + b"\r\n\r\n"):
            with socket.create_connection(("127.0.0.1", self.port), timeout=100) as connection:
                connection.sendall(text)
                connection.shutdown(socket.SHUT_WR)
                try:
                    while connection.recv(65536):
                        pass
                except ConnectionResetError:
                    pass
        self.assertEqual(self.ask("/").status, 200)


if __name__ == "__main__":
    main()
