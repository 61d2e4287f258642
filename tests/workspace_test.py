#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Checks that a ROS workspace with this repository in it works: rosdep knows every dependency in the package.xml files,
these name all that is used, colcon finds the packages, and each of them stands alone.

Usage: workspace_test.py SOURCE_DIR. Uses the standard library only, and colcon where it is installed. A key that rosdep
does not know stops the whole installation. A new dependency therefore gets its line here, copied from ros/rosdistro
(rosdep/base.yaml). tools/test_documented_build builds the packages.
"""
import os
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
    "libcpp-httplib-dev": "libcpp-httplib-dev",
    "libexpected-dev": "libexpected-dev",
    "libgmock-dev": "libgmock-dev",
    "libgtest-dev": "libgtest-dev",
    "libncurses-dev": "libncurses-dev",
    "libyaml-dev": "libyaml-dev",
    "nlohmann-json-dev": "nlohmann-json3-dev",
    "pkg-config": "pkg-config",
    "tbb": "libtbb-dev",
    "zlib": "zlib1g-dev",
}
# Packages of the distributions themselves: ros-<distribution>-<name>.
ROS_KEYS = {"ament_cmake", "ament_index_python", "composition_interfaces", "diagnostic_msgs", "launch", "launch_ros", "rcl",
            "rcl_interfaces", "rclcpp", "rclcpp_action", "rclcpp_components", "rclcpp_lifecycle", "rcutils", "rmw",
            "rosgraph_msgs", "std_msgs", "std_srvs", "test_msgs", "tracetools"}
# Names that find_package() looks for, with the rosdep key that installs them. The C library has the threads,
# and packages are built without LTTng.
CMAKE_PACKAGES = {"fmt": "fmt", "nlohmann_json": "nlohmann-json-dev", "tl-expected": "libexpected-dev",
                  "CLI11": "cli11", "TBB": "tbb", "GTest": "libgtest-dev", "LibYAML": "libyaml-dev", "ZLIB": "zlib",
                  "Curses": "libncurses-dev", "PkgConfig": "pkg-config", "LttngUst": None, "Threads": None}
# Folders that headers are included from, with the rosdep key that installs them. Others have the name of their package.
# babeltrace2 is used where it is there.
HEADER_FOLDERS = {"fmt": "fmt", "nlohmann": "nlohmann-json-dev", "tl": "libexpected-dev", "CLI": "cli11", "tbb": "tbb",
                  "oneapi": "tbb", "gtest": "libgtest-dev", "gmock": "libgmock-dev", "arpa": None,
                  "babeltrace2": None, "sys": None, "linux": None, "bits": None}
# Peers and stacks for comparisons, which are used where they are installed, and what only these comparisons need.
OPTIONAL = {"redag_rclcpp": {"cm_executors"},
            "redag_rclcpp_lab": {"autoware_reference_system", "cm_executors", "reference_interfaces", "reference_system",
                                 "ament_index_cpp", "composition_interfaces", "rclcpp_components",
                                 "controller_interface", "controller_manager", "controller_manager_msgs",
                                 "hardware_interface", "pluginlib", "sensor_msgs",
                                 "geometry_msgs", "nav2_controller", "nav2_msgs", "nav_msgs",
                                 "message_filters", "rclcpp_action", "rosbag2_cpp", "rosbag2_storage", "rosbag2_transport",
                                 "tf2_ros"}}
# Folders of the repository that a package uses where they are there, and does without elsewhere.
BESIDE = ("../../evaluation/benchmarks/counted", "../../tests/testing")
ROS_PACKAGES = ("redag_rclcpp", "redag_rclcpp_lab")
PACKAGES = ("redag", "redag_analysis", "redag_lab", *ROS_PACKAGES)


def folder_of(package):
    return SOURCE / "ros" / package if package in ROS_PACKAGES else SOURCE / package


def version_of(package):
    return xml.etree.ElementTree.parse(folder_of(package) / "package.xml").getroot().findtext("version")


def files_of(package, *endings):
    """Returns the files of a package with these endings, without what others wrote."""
    return [file for file in sorted((folder_of(package)).rglob("*"))
            if file.name.endswith(endings) and "third_party" not in file.parts]


def looked_for(package):
    """Returns the names of the packages that a CMakeLists.txt looks for, and cannot do without."""
    text = re.sub(r"#.*", "", (folder_of(package) / "CMakeLists.txt").read_text())
    in_lists = {name for items, _ in re.findall(
        r"foreach\(package IN ITEMS ([^)]*)\)\s*find_package\((\$\{package\}) REQUIRED\)", text) for name in items.split()}
    return in_lists | set(re.findall(r"find_package\((\w[\w-]*)[^)]*REQUIRED\)", text))


def keys_of(package):
    root = xml.etree.ElementTree.parse(folder_of(package) / "package.xml").getroot()
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


class Scripts(unittest.TestCase):
    """Scripts that need ROS 2 or rosdep find each package, though they rarely run."""

    def test_the_documented_build_tries_each_package_alone(self):
        text = (SOURCE / "tools" / "test_documented_build").read_text()
        steps = re.findall(r'"([\w/]+)":', re.search(r"(?s)^STEPS = \{(.*?)\}", text, re.M)[1])
        self.assertEqual({SOURCE / folder for folder in steps}, {folder_of(package) for package in PACKAGES})

    def test_rosdep_learns_of_each_package(self):
        patterns = re.search(r"for package in (\S*package\.xml.*); do", (SOURCE / "tools" / "debian_packages").read_text())[1]
        found = {file.parent for pattern in patterns.split() for file in SOURCE.glob(pattern)}
        self.assertEqual(found, {folder_of(package) for package in PACKAGES})


class Citation(unittest.TestCase):
    def test_the_version_is_the_one_of_the_packages(self):
        stated = re.search(r"(?m)^version: (.+)$", (SOURCE / "CITATION.cff").read_text())[1]
        self.assertEqual(stated, version_of("redag"))


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
        """A package.xml lists everything that the CMakeLists.txt looks for, regardless of what its dependencies need."""
        for package in PACKAGES:
            found = looked_for(package) - OPTIONAL.get(package, set())
            self.assertGreater(len(found), 2, package)
            keys = keys_of(package)
            for name in found:
                key = CMAKE_PACKAGES.get(name, name)
                self.assertTrue(key is None or key in keys, f"{package}: find_package({name}), but no <depend> on {key}")

    def test_what_is_included_is_declared(self):
        """Tests of redag, redag_analysis and redag_lab belong to the repository's build."""
        for package in PACKAGES:
            keys, folders = keys_of(package), set()
            for file in files_of(package, ".hpp", ".cpp"):
                if package in ROS_PACKAGES or not file.stem.endswith("_test"):
                    found = re.findall(r'^\s*#\s*include\s*[<"](\w+)/', file.read_text(), re.MULTILINE)
                    homes = file.parent, folder_of(package) / "src"
                    folders.update(name for name in found if not any((home / name).is_dir() for home in homes))
            self.assertGreater(len(folders), 2, package)
            for folder in folders - OPTIONAL.get(package, set()) - {package}:
                key = HEADER_FOLDERS.get(folder, folder)
                self.assertTrue(key is None or key in keys, f"{package} includes {folder}/, but has no <depend> on {key}")

    def test_redag_needs_no_test_library(self):
        """colcon builds the libraries and the program. The repository's own build holds their tests."""
        for package in ("redag", "redag_analysis", "redag_lab"):
            self.assertFalse({"librapidcheck-dev", "rapidcheck"} & keys_of(package))
            self.assertNotIn("BUILD_TESTING", (folder_of(package) / "CMakeLists.txt").read_text())


class Alone(unittest.TestCase):
    """A release has one source tree for each package."""

    def test_no_build_file_leaves_its_folder(self):
        for package in PACKAGES:
            files = files_of(package, "CMakeLists.txt", ".cmake", ".in")
            self.assertGreater(len(files), 0, package)
            for file in files:
                text = file.read_text()
                for place in BESIDE:
                    if f"EXISTS ${{CMAKE_CURRENT_SOURCE_DIR}}/{place}" in text:
                        text = text.replace(place, "")
                for line in text.splitlines():
                    self.assertNotIn("../", line, f"{file.relative_to(SOURCE)} uses what a release of {package} does not have")

    def test_no_link_leaves_its_folder(self):
        for package in PACKAGES:
            for file in (folder_of(package)).rglob("*"):
                if file.is_symlink():
                    self.assertIn(folder_of(package), file.resolve().parents, file)

    def test_all_have_one_version(self):
        self.assertEqual({version_of(package) for package in PACKAGES}, {version_of("redag")})
        for package in PACKAGES:
            text = (folder_of(package) / "CMakeLists.txt").read_text()
            self.assertRegex(text, rf"project\({package} VERSION \$\{{version\}} ")


class Release(unittest.TestCase):
    """What docs/releasing.md asks for."""

    def test_the_changelog_begins_with_the_version(self):
        """bloom makes the changelog of the Debian package of the entry with the version of package.xml."""
        for package in PACKAGES:
            text = (folder_of(package) / "CHANGELOG.rst").read_text()
            line, title, again, _, entry, under = text.splitlines()[:6]
            self.assertEqual((line, title, again), ("^" * len(title), f"Changelog for package {package}", line))
            if entry != "Forthcoming":
                self.assertRegex(entry, rf"^{re.escape(version_of(package))} \(\d{{4}}-\d\d-\d\d\)$", package)
            self.assertEqual(under, "-" * len(entry), package)

    def test_each_package_has_its_pages(self):
        for package in PACKAGES:
            self.assertTrue((folder_of(package) / "rosdoc2.yaml").is_file(), package)
            page = (folder_of(package) / "README.md").read_text()
            self.assertTrue(page.startswith(f"# {package}\n"), package)
            declaration = os.path.relpath(SOURCE / "QUALITY_DECLARATION.md", folder_of(package))
            self.assertIn(f"]({declaration})", page, package)

    def test_licences_have_their_texts(self):
        for package in PACKAGES:
            root = xml.etree.ElementTree.parse(folder_of(package) / "package.xml").getroot()
            self.assertEqual(root.findtext("license"), "Apache-2.0", package)
            for licence in root.iter("license"):
                if licence.get("file"):
                    self.assertTrue((folder_of(package) / licence.get("file")).is_file(), package)


if __name__ == "__main__":
    SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
