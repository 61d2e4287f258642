#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Checks that a ROS workspace with this repository in it works: rosdep knows every dependency in the package.xml files,
and colcon finds the packages.

Usage: workspace_test.py SOURCE_DIR. Uses the standard library only, and colcon where it is installed. A key that rosdep
does not know stops the whole installation. A new dependency therefore gets its line here, copied from ros/rosdistro
(rosdep/base.yaml).
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

# rosdep key -> Debian and Ubuntu package, from rosdep/base.yaml.
SYSTEM_KEYS = {
    "cli11": "libcli11-dev",
    "cmake": "cmake",
    "fmt": "libfmt-dev",
    "libexpected-dev": "libexpected-dev",
    "libgmock-dev": "libgmock-dev",
    "libgtest-dev": "libgtest-dev",
    "libyaml-dev": "libyaml-dev",
    "nlohmann-json-dev": "nlohmann-json3-dev",
    "tbb": "libtbb-dev",
    "zlib": "zlib1g-dev",
}
# Packages of the distributions themselves: ros-<distribution>-<name>.
ROS_KEYS = {"ament_cmake", "diagnostic_msgs", "launch_ros", "rclcpp", "rclcpp_action", "rclcpp_components",
            "rclcpp_lifecycle", "std_msgs", "std_srvs", "test_msgs"}
# Names that find_package() looks for, with the rosdep key that installs them.
CMAKE_PACKAGES = {"fmt": "fmt", "nlohmann_json": "nlohmann-json-dev", "tl-expected": "libexpected-dev",
                  "CLI11": "cli11", "TBB": "tbb", "GTest": "libgtest-dev"}
ROS_PACKAGES = ("redag_rclcpp", "redag_rclcpp_lab")
PACKAGES = ("redag", "redag_analysis", "redag_lab", *ROS_PACKAGES)


def keys_of(package):
    root = xml.etree.ElementTree.parse(SOURCE / package / "package.xml").getroot()
    return {element.text.strip() for element in root if element.tag.endswith("depend")}


def colcon_list(*arguments):
    """Returns the names of the packages that colcon finds in a workspace with a clone of this repository."""
    with tempfile.TemporaryDirectory() as workspace:
        source = pathlib.Path(workspace, "src")
        source.mkdir()
        (source / "redag-rt").symlink_to(SOURCE)
        # colcon imports modules of the system's Python.
        command = ["/usr/bin/env", "PATH=/usr/bin:/bin", "colcon", "--log-base", "/dev/null", "list", "--names-only", *arguments]
        return subprocess.run(command, cwd=workspace, capture_output=True, text=True, check=True).stdout.split()


@unittest.skipUnless(shutil.which("colcon", path="/usr/bin:/bin"), "no colcon (Debian: colcon)")
class Colcon(unittest.TestCase):
    def test_the_packages_are_found_and_nothing_else(self):
        self.assertEqual(sorted(colcon_list()), sorted(PACKAGES))

    def test_what_the_executor_needs(self):
        self.assertEqual(colcon_list("--packages-up-to", "redag_rclcpp"), ["redag", "redag_analysis", "redag_rclcpp"])


class Rosdep(unittest.TestCase):
    def test_every_key_is_known(self):
        for package in PACKAGES:
            unknown = keys_of(package) - set(SYSTEM_KEYS) - ROS_KEYS - set(PACKAGES)
            self.assertEqual(unknown, set(), f"{package}/package.xml: no key of rosdep, or not listed in this test")

    def test_every_key_is_installed_by_bootstrap(self):
        """The Debian names are correct: tools/bootstrap, which builds without ROS, lists the same."""
        words = set(re.findall(r"[\w.+-]+", (SOURCE / "tools/bootstrap").read_text()))
        for package in PACKAGES:
            for key in keys_of(package) & set(SYSTEM_KEYS):
                self.assertIn(SYSTEM_KEYS[key], words, f"{package}/package.xml: {key}")

    def test_what_is_found_is_declared(self):
        """The package.xml of a ROS package lists everything that its CMakeLists.txt needs, regardless of redag's
        dependencies."""
        for package in ROS_PACKAGES:
            found = re.findall(r"^ *find_package\((\S+)[^)]*REQUIRED\)",
                               (SOURCE / package / "CMakeLists.txt").read_text(), re.MULTILINE)
            self.assertGreater(len(found), 5, package)
            keys = keys_of(package)
            for name in found:
                # The packages reference_* belong to the optional Autoware reference system.
                if "$" not in name and not name.startswith("reference_"):
                    self.assertIn(CMAKE_PACKAGES.get(name, name), keys, f"{package}: find_package({name})")

    def test_redag_needs_no_test_library(self):
        """colcon builds the libraries and the program. The repository's own build holds their tests."""
        for package in ("redag", "redag_analysis", "redag_lab"):
            self.assertFalse({"librapidcheck-dev", "rapidcheck"} & keys_of(package))
            self.assertNotIn("BUILD_TESTING", (SOURCE / package / "CMakeLists.txt").read_text())


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
