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
import signal
import socket
import subprocess
import tempfile

from program import PROGRAM, Case, main, redag


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

    def run_executor(self):
        process = subprocess.Popen([PROGRAM, "run", self.cart, "--duration", "1h", "--json"],
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
        for path in ("/", "/live.js", "/style.css", "/echarts.js", "/events", "/nothing", "/?token=", "/?token=" + "0" * 64,
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
