#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Checks that every workload and robot satisfies its schema in docs/, and that the schemas refuse bad files.

Needs python3-jsonschema and python3-yaml. Run: python3 tests/schema_test.py
"""

import copy
import json
import pathlib
import unittest

import jsonschema
import yaml

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCHEMA = json.loads((ROOT / "docs" / "workload.schema.json").read_text(encoding="utf-8"))
ROBOT_SCHEMA = json.loads((ROOT / "docs" / "robot.schema.json").read_text(encoding="utf-8"))
ROBOT = """
robot: cart
cpu_sets: [{name: fast, cpus: 0-1}]
processes:
  - {name: base, cpus: fast, workload: base.yaml}
  - name: arm
    workload: {dags: [{name: d, tasks: [{name: t, wcet: 1ms, period: 5ms}]}]}
threads:
  - {name: t, level: {task: arm.d.t}}
  - {name: u, level: {reservation: {budget: 1ms, period: 5ms, tick: 4ms}}}
"""
TASK = {"name": "t", "wcet": "1ms", "period": "10ms"}
CALLBACKS = (
    {"timer": "2ms"},
    {"timer": "any"},
    {"timer": {"index": 0}},
    {"timer": {"period": "2ms", "index": 3}},
    {"subscription": "/imu/data"},
    {"service": "/set_*"},
    {"client": "*/plan"},
    {"action": "/navigate"},
    {"waitable": "any"},
    {"waitable": {"index": 1}},
)
BAD_CALLBACKS = (
    "/n",
    {"timer": "2ms"},
    {"node": "/n"},
    {"node": "n", "timer": "any"},
    {"node": "/n/", "timer": "any"},
    {"node": "/", "timer": "any"},
    {"node": "/a//b", "timer": "any"},
    {"node": "/a b", "timer": "any"},
    {"node": "/n", "timer": "2ms", "service": "/s"},
    {"node": "/n", "timer": 0},
    {"node": "/n", "timer": {}},
    {"node": "/n", "timer": {"indx": 0}},
    {"node": "/n", "timer": {"index": -1}},
    {"node": "/n", "waitable": "2ms"},
    {"node": "/n", "waitable": {"period": "2ms"}},
    {"node": "/n", "subscription": "imu"},
    {"node": "/n", "topic": "/imu"},
)


def errors(document):
    return [error.message for error in jsonschema.Draft7Validator(SCHEMA).iter_errors(document)]


def robot_errors(document):
    place = (ROOT / "docs").as_uri()
    resolver = jsonschema.RefResolver(f"{place}/robot.schema.json", ROBOT_SCHEMA,
                                      store={f"{place}/workload.schema.json": SCHEMA})
    return [error.message for error in jsonschema.Draft7Validator(ROBOT_SCHEMA, resolver=resolver).iter_errors(document)]


def with_task(**changes):
    """A workload of one task with these values; ... removes a key."""
    task = {key: value for key, value in {**TASK, **changes}.items() if value is not ...}
    return {"dags": [{"name": "d", "tasks": [task]}]}


class SchemaTest(unittest.TestCase):
    def test_refuses_what_the_loader_refuses(self):
        for key in ("budget", "region", "period", "deadline", "wcet"):
            self.assertTrue(errors(with_task(**{key: "0ms"})), key)
        for key in ("offset", "jitter", "bcet"):
            self.assertEqual(errors(with_task(**{key: "0ms"})), [], key)
        for name in ("a\x1bb", "a\u009bb", " a", "a ", "x" * 1001):
            self.assertTrue(errors(with_task(name=name)), repr(name))
        self.assertEqual(errors(with_task(name="µ arm 2")), [])
        self.assertTrue(errors({"dags": [{"name": "d", "max_active": 1000001, "tasks": [TASK]}]}))

    def test_is_a_schema(self):
        jsonschema.Draft7Validator.check_schema(SCHEMA)

    def test_shipped_workloads_satisfy_it(self):
        files = [file for folder in ("workloads", "ros/redag_rclcpp/config") for file in sorted((ROOT / folder).rglob("*.yaml"))]
        self.assertGreaterEqual(len(files), 9)
        for file in files:
            with self.subTest(file=file.name):
                self.assertEqual(errors(yaml.safe_load(file.read_text(encoding="utf-8"))), [])

    def test_documented_example_satisfies_it(self):
        text = (ROOT / "docs" / "workload_format.md").read_text(encoding="utf-8")
        examples = [part.split("```")[0] for part in text.split("```yaml")[1:]]
        self.assertTrue(examples)
        for example in examples:
            self.assertEqual(errors(yaml.safe_load(example)), [])

    def test_accepts_every_form(self):
        for changes in (
            {"overrun": "skip"},
            {"overrun": {"queue": 3}},
            {"execution": {"normal": {"mean": "1ms", "stddev": "10us"}}},
            {"execution": {"empirical": ["1ms", "0.5 ms"]}},
            {"after": "a"},
            {"after": ["a", "b"]},
            {"offset": 0},
            {"offset": "any"},
            {"activation": "event", "period": "9ms"},
            {"wcet": "1µs"},
            {"wcet": ".5ms"},
            {"concurrency": 2},
            {"budget": "2ms", "on_budget": "skip_next"},
            {"wcet_low": "1ms"},
            {"period": ..., "rate": "30Hz"},
            {"period": ..., "rate": ".5 kHz"},
            *({"callback": {"node": "/n", **of}} for of in CALLBACKS),
        ):
            with self.subTest(changes=changes):
                self.assertEqual(errors(with_task(**changes)), [])

    def test_refuses(self):
        for changes in (
            {"wcet": 5},
            {"wcet": "5"},
            {"wcet": "-5ms"},
            {"wcet": "5 parsec"},
            {"wect": "5ms"},
            {"overrun": "drop"},
            {"overrun": {"queue": 0}},
            {"execution": "normal"},
            {"execution": {"normal": {"mean": "1ms"}}},
            {"activation": "message"},
            {"priority": "high"},
            {"after": ["a", "a"]},
            {"concurrency": 0},
            {"concurrency": 1025},
            {"on_budget": "kill"},
            {"wcet_low": 1},
            {"rate": "30Hz"},
            *({"period": ..., "rate": rate} for rate in (30, "30", "0Hz", "0.0 kHz", "-1Hz", "10ms", "30hz")),
            *({"callback": callback} for callback in BAD_CALLBACKS),
        ):
            with self.subTest(changes=changes):
                self.assertNotEqual(errors(with_task(**changes)), [])

    def test_degrade(self):
        for degrade, is_valid in (
            ("stop", True),
            ({"skip": 3}, True),
            ({"stretch": 1.5}, True),
            ("pause", False),
            ({"skip": 0}, False),
            ({"stretch": 0.5}, False),
            ({"skip": 1, "stretch": 2}, False),
        ):
            with self.subTest(degrade=degrade):
                document = with_task()
                document["dags"][0]["degrade"] = degrade
                self.assertEqual(errors(document) == [], is_valid)

    def test_clusters(self):
        for platform, is_valid in (
            ({"clusters": [{"name": "left", "cpus": "0-7", "workers": 8}]}, True),
            ({"clusters": [{"name": "left", "cpus": [0, "2-5"]}, {"name": "right", "cpus": 6}]}, True),
            ({"clusters": []}, False),
            ({"clusters": [{"workers": 1}]}, False),
            ({"clusters": [{"name": "left", "cpus": "all"}]}, False),
            ({"clusters": [{"name": "left", "workers": 0}]}, False),
            ({"clusters": [{"name": "left"}], "workers": 1}, False),
            ({"clusters": [{"name": "left"}], "cpus": 1}, False),
        ):
            with self.subTest(platform=platform):
                document = with_task()
                document["platform"] = platform
                document["dags"][0]["cluster"] = "left"
                self.assertEqual(errors(document) == [], is_valid)

    def test_processors_of_the_platform(self):
        for cpus, is_valid in ((3, True), ("0-3", True), ([2, "4-5"], True), ([], False), ("all", False)):
            with self.subTest(cpus=cpus):
                self.assertEqual(errors({**with_task(), "platform": {"cpus": cpus}}) == [], is_valid)

    def test_devices(self):
        for devices, is_valid in (
            ({"gpu": {"slots": 2, "queue": "fifo"}, "dla": None}, True),
            ({"gpu": {"slots": 0}}, False),
            ({"gpu": {"queue": "lifo"}}, False),
            (["gpu"], False),
        ):
            with self.subTest(devices=devices):
                self.assertEqual(errors({**with_task(), "platform": {"devices": devices}}) == [], is_valid)
        both = {"devices": {"gpu": {}}, "clusters": [{"name": "left"}]}
        self.assertNotEqual(errors({**with_task(), "platform": both}), [])

    def test_segments(self):
        cpu = {"cpu": "1ms"}
        for segments, is_valid in (
            ([cpu, {"device": "gpu", "for": "2ms", "at_least": "1ms"}, cpu], True),
            ([cpu, {"wait": "2ms"}, cpu, {"wait": "2ms", "at_least": "1ms"}, cpu], True),
            ([cpu, {"device": "gpu"}, cpu], False),
            ([cpu, {"wait": "2ms", "for": "1ms"}, cpu], False),
            ([cpu, {"wait": 0}, cpu], False),
            ([cpu], False),
            ("5ms", False),
        ):
            with self.subTest(segments=segments):
                document = with_task(segments=segments)
                del document["dags"][0]["tasks"][0]["wcet"]
                self.assertEqual(errors(document) == [], is_valid)
        self.assertNotEqual(errors(with_task(segments=[cpu, {"wait": "2ms"}, cpu])), [])

    def test_only_a_callback_may_be_without_wcet(self):
        document = with_task(callback={"node": "/n", "timer": "any"})
        del document["dags"][0]["tasks"][0]["wcet"]
        self.assertEqual(errors(document), [])
        del document["dags"][0]["tasks"][0]["callback"]
        self.assertNotEqual(errors(document), [])

    def test_robots(self):
        jsonschema.Draft7Validator.check_schema(ROBOT_SCHEMA)
        files = [ROOT / "examples" / name for name in ("robot/cart.yaml",)]
        texts = [file.read_text(encoding="utf-8") for file in files]
        page = (ROOT / "docs" / "robot.md").read_text(encoding="utf-8")
        blocks = [part.split("```")[0] for part in page.split("```yaml")[1:]]
        texts += [block for block in blocks if block.lstrip().startswith("robot:")]
        self.assertGreater(len(texts), len(files))
        for text in [*texts, ROBOT]:
            self.assertEqual(robot_errors(yaml.safe_load(text)), [], text)

    def test_refuses_bad_robots(self):
        for level in ("above", {"rate": "5ms"}, {"rate": "200Hz"}):
            document = yaml.safe_load(ROBOT)
            document["threads"][0]["level"] = level
            self.assertEqual(robot_errors(document), [], level)
        for key, value in (("cpus", "0"), ("processes", []), ("policy", "edf"), ("robots", 1)):
            self.assertTrue(robot_errors({**yaml.safe_load(ROBOT), key: value}), key)
        for key, value in (("level", "top"), ("level", {"nice": 1}), ("level", {"rate": "5ms", "task": "a.b.c"}),
                           ("match", {}), ("count", 0), ("wcet", "0ms")):
            document = yaml.safe_load(ROBOT)
            document["threads"][0][key] = value
            self.assertTrue(robot_errors(document), (key, value))

    def test_refuses_incomplete_documents(self):
        self.assertNotEqual(errors({}), [])
        self.assertNotEqual(errors({"dags": []}), [])
        for key in ("name", "tasks"):
            document = copy.deepcopy(with_task())
            del document["dags"][0][key]
            self.assertNotEqual(errors(document), [], key)


if __name__ == "__main__":
    unittest.main()
