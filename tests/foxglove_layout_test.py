#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Checks that the layout for Foxglove fits together, and shows what the packages for ROS 2 publish.

Usage: foxglove_layout_test.py SOURCE_DIR. Uses the standard library only. Where a ROS distribution with the messages is
installed, the fields are compared with its definitions. docs/evidence/ros2.md tells how Lichtblick's own code read the
layout.
"""
import json
import os
import pathlib
import re
import sys
import unittest

# Fields of the messages: "[]" marks an array, and a name of another type here that type.
MESSAGES = {
    "diagnostic_msgs/DiagnosticArray": {"header": "std_msgs/Header", "status": "diagnostic_msgs/DiagnosticStatus[]"},
    "diagnostic_msgs/DiagnosticStatus": {"level": "byte", "name": "string", "message": "string", "hardware_id": "string",
                                         "values": "diagnostic_msgs/KeyValue[]"},
    "pal_statistics_msgs/Statistics": {"header": "std_msgs/Header", "statistics": "pal_statistics_msgs/Statistic[]"},
    "pal_statistics_msgs/Statistic": {"name": "string", "value": "float64"},
}
# Which file makes a topic, and the text there.
TOPICS = {
    "/diagnostics": ("diagnostic_msgs/DiagnosticArray", "redag_rclcpp/src/monitor.cpp",
                     ['create_publisher<DiagnosticArray>("/diagnostics"']),
    "/redag_statistics/full": ("pal_statistics_msgs/Statistics", "redag_rclcpp_lab/src/statistics_publisher.cpp",
                               ['create_publisher<Statistics>("~/full"']),
}
# Panels of the last version of Foxglove Studio with open source, and the keys of their settings with message paths.
PANELS = {"DiagnosticSummary": [], "DiagnosticStatusPanel": [], "StateTransitions": ["paths"], "Table": ["topicPath"],
          "Plot": ["paths"]}


def parse_path(text):
    """Returns the topic and the parts of a message path: field names, "[]", and filters as (field, value)."""
    match = re.match(r"(/[\w/]+)((?:\.\w+|\[:\]|\{[^}]+\})*)$", text)
    if not match:
        raise ValueError(f"no message path: {text}")
    parts = []
    for field, slice_, filter_ in re.findall(r"\.(\w+)|(\[:\])|\{([^}]*)\}", match[2]):
        if filter_:
            of_filter = re.match(r'(\w+)==(?:"([^"]*)"|\$(\w+))$', filter_)
            if not of_filter:
                raise ValueError(f"no filter: {filter_}")
            parts.append((of_filter[1], of_filter[2] if of_filter[3] is None else "$" + of_filter[3]))
        else:
            parts.append(field or slice_.replace(":", ""))
    return match[1], parts


def panels_in(node):
    """Returns the panels of a part of the window, from left to right and top to bottom."""
    if isinstance(node, str):
        return [node]
    if set(node) - {"splitPercentage"} != {"first", "second", "direction"} or node["direction"] not in ("row", "column"):
        raise ValueError(f"no part of a layout: {node}")
    return panels_in(node["first"]) + panels_in(node["second"])


class Layout(unittest.TestCase):
    def setUp(self):
        self.layout = json.loads((SOURCE / "redag_rclcpp/config/foxglove/redag.json").read_text())
        self.variables = self.layout["globalVariables"]
        (script,) = self.layout["userNodes"].values()
        self.script = script["sourceCode"]
        row = re.search(r"type Row = \{(.*?)\};", self.script, re.DOTALL)[1]
        self.row = dict(re.findall(r"(\w+): (\w+);", row))
        self.types = {**MESSAGES, "Output": {"rows": "Row[]"}, "Row": self.row}
        self.topics = {topic: where[0] for topic, where in TOPICS.items()}
        self.topics[re.search(r'export const output = "([^"]+)";', self.script)[1]] = "Output"

    def paths(self):
        for panel, settings in self.layout["configById"].items():
            for key in PANELS[panel.split("!")[0]]:
                if key == "paths":
                    yield from (path["value"] for path in settings["paths"])
                else:
                    yield settings[key]

    def test_has_the_keys_of_a_layout(self):
        self.assertEqual(set(self.layout), {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"})

    def test_each_panel_has_its_settings_and_its_place(self):
        shown = panels_in(self.layout["layout"])
        self.assertEqual(len(shown), len(set(shown)))
        self.assertEqual(set(shown), set(self.layout["configById"]))
        for panel in shown:
            kind, mark, name = panel.partition("!")
            self.assertIn(kind, PANELS)
            self.assertTrue(mark and name, panel)

    def test_each_path_names_a_field_that_is_published(self):
        paths = list(self.paths())
        self.assertGreater(len(paths), 10)
        for path in paths:
            topic, parts = parse_path(path)
            self.assertIn(topic, self.topics, path)
            kind = self.topics[topic]
            for part in parts:
                if part == "[]":
                    self.assertTrue(kind.endswith("[]"), path)
                    kind = kind[:-2]
                elif isinstance(part, tuple):
                    self.assertEqual(self.types[kind][part[0]], "string", path)
                else:
                    self.assertIn(part, self.types[kind], path)
                    kind = self.types[kind][part]
            is_table = path == self.layout["configById"]["Table!redag"]["topicPath"]
            self.assertIn(kind, ["Row[]"] if is_table else ["number", "byte"], path)

    def test_each_variable_has_a_value(self):
        used = {name for path in self.paths() for name in re.findall(r"\$(\w+)", path)}
        self.assertEqual(used, set(self.variables))

    def test_the_diagnostics_have_these_names(self):
        report = (SOURCE / "redag_rclcpp/src/report.cpp").read_text()
        names = {value for path in self.paths() for part in parse_path(path)[1] if isinstance(part, tuple)
                 for value in part[1:] if not value.startswith("$")}
        names.add(self.layout["configById"]["DiagnosticStatusPanel!redag"]["selectedName"])
        self.assertEqual(names, {"ReDAG: executor"})
        self.assertIn('status.name = "ReDAG: executor";', report)
        self.assertIn('"ReDAG: DAG "', report)

    def test_the_variables_name_what_the_example_has(self):
        """Without a change, the layout shows the example that the package launches."""
        example = (SOURCE / "redag_rclcpp/config/example.yaml").read_text()
        executor, dag, task = self.variables["redag_callback"].split("/")
        self.assertRegex(example, rf"(?m)^name: {executor}$")
        of_dag = re.search(rf"(?ms)^  - name: {dag}\n(.*?)(?=^  - name: |\Z)", example)[1]
        self.assertIn(f"{{name: {task}, ", of_dag)
        self.assertEqual(self.variables["redag_status"], f"ReDAG: DAG {dag}")

    def test_the_topics_are_published(self):
        for topic, (_, file, texts) in TOPICS.items():
            source = (SOURCE / file).read_text()
            for text in texts:
                self.assertIn(text, source, topic)
        program = (SOURCE / "redag_rclcpp_lab/src/programs/publish_statistics.cpp").read_text()
        self.assertIn('rclcpp::Node>("redag_statistics")', program)

    def test_the_script_reads_figures_that_are_published(self):
        (topic,) = re.search(r"export const inputs = \[(.*)\];", self.script)[1].replace('"', "").split(",")
        self.assertIn(topic, TOPICS)
        self.assertIn(f'Input<"{topic}">', self.script)
        source = (SOURCE / "redag_rclcpp_lab/src/live_statistics.cpp").read_text()
        of_rows = set(re.findall(r'Column<(?:Figures|TaskFrame|DagFrame)>\{\s*"(\w+)"', source))
        self.assertGreater(len(of_rows), 20)
        asked = set(re.findall(r'(?:of|known\.has)\("(\w+)"\)', self.script))
        self.assertEqual(asked, set(self.row) - {"name"})
        self.assertLessEqual(asked, of_rows)

    def test_the_fields_are_those_of_the_installed_messages(self):
        places = [pathlib.Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if prefix]
        places += sorted(pathlib.Path("/opt/ros").glob("*"))
        found = 0
        for name, fields in MESSAGES.items():
            package, message = name.split("/")
            for place in places:
                file = place / "share" / package / "msg" / f"{message}.msg"
                if not file.is_file():
                    continue
                found += 1
                lines = re.sub(r"#.*", "", file.read_text()).splitlines()
                pairs = [line.split() for line in lines if line.strip() and "=" not in line]
                self.assertEqual({pair[1]: pair[0] for pair in pairs},
                                 {key: value.removeprefix(package + "/") for key, value in fields.items()}, file)
        if found == 0:
            self.skipTest("no ROS distribution has these messages here")

    def test_mistakes_in_paths_are_found(self):
        for bad in ["diagnostics.status", "/a.b{name=x}", "/a.b[0:", "/a.b{}", "/a.b c"]:
            with self.assertRaises(ValueError, msg=bad):
                parse_path(bad)
        with self.assertRaises(ValueError):
            panels_in({"first": "a", "second": "b"})


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
