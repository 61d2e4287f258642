#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Executes the code blocks of README.md, of all pages below docs, and of every folder's README.md, as a reader would.

Usage: code_blocks.py PROGRAM SOURCE_DIR BUILD_DIR CXX CMAKE [PAGE...]

The blocks of a page run in order in one new folder, which has the repository's workloads and experiments. The program
is in PATH, and the build is installed where CMake and pkg-config find it. By language:

    sh        runs, and every command has to succeed
    console   lines that begin with "$ " run, and print what follows them, if anything does; "..." is any text
    cpp       compiles; a part of a program, inside main(); with ROS 2, where it is installed
    yaml      is a valid workload, plan or file of overheads
    cmake     is for a file; the page's commands use it
    xml       is well-formed
    diff, sql, text and blocks without a language are no code

A comment before a block changes that. "not run" blocks are counted, with their reasons. Their commands are still parsed,
and what they name has to exist: options of redag, files, programs and parameters of ROS 2, variables, and tests.

    <!-- not run: REASON -->
    <!-- run with: TEXT = OTHER -->          another text in the place of one, for example a shorter time
    <!-- compiled with: DECLARATIONS -->     what a part of a program needs
    <!-- file: NAME -->                      the block is also the content of a file
"""
import collections
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree

MARKS = ("not run", "run with", "compiled with", "file")
# The README is the front page and has no marks. By a text of the block.
README = {
    "make demo": ("not run", "builds everything; .ci/run runs both commands as they stand here"),
    "git clone <this repository>": ("not run", "needs ROS 2; tools/test_documented_build runs it"),
    "redag_rclcpp::ReDAGExecutor executor;": ("compiled with", "struct Robot : rclcpp::Node { Robot() : Node(\"robot\") {} };"),
    "read_imu()": ("compiled with", "void read_imu(); void actuate();"),
}
NO_CODE = {"", "text", "diff", "sql"}
PATIENCE = 300  # s for one block

Block = collections.namedtuple("Block", "page line language text marks")


class Wrong(Exception):
    """What is wrong with a block."""


def blocks_of(page, source):
    lines = (source / page).read_text(encoding="utf-8").splitlines()
    found, marks, at = [], {}, 0
    while at < len(lines):
        mark = re.fullmatch(r"\s*<!-- ([a-z ]+): (.+) -->", lines[at])
        fence = re.fullmatch(r"(\s*)```(\w*)", lines[at])
        if mark and mark[1] in MARKS:
            marks[mark[1]] = "\n".join(filter(None, [marks.get(mark[1]), mark[2]]))
        elif fence:
            end = next(n for n in range(at + 1, len(lines)) if lines[n] == fence[1] + "```")
            text = "".join(line.removeprefix(fence[1]) + "\n" for line in lines[at + 1:end])
            if page == "README.md":
                marks.update([mark for part, mark in README.items() if part in text])
            found.append(Block(page, at + 1, fence[2], text, marks))
            marks, at = {}, end
        elif lines[at].strip():
            if marks:
                raise Wrong(f"{page}:{at + 1}: the comment before this line belongs to no block")
        at += 1
    return found


class Page:
    """Executes the blocks of one page in a folder of its own."""

    def __init__(self, folder, tools, source):
        self.folder, self.tools = folder, tools
        for name in "workloads", "evaluation", "examples":
            (folder / name).symlink_to(source / name)
        path = os.pathsep.join([str(tools.program.parent), os.environ["PATH"]])
        self.environment = {**os.environ, "PATH": path, "CMAKE_PREFIX_PATH": str(tools.prefix), "CXX": tools.cxx,
                            "PKG_CONFIG_PATH": str(tools.pkgconfig), "NO_COLOR": "1", "HOME": str(folder)}
        # A library that is found there at run time, as an installed one is.
        self.environment["LD_LIBRARY_PATH"] = str(tools.pkgconfig.parent)

    def call(self, command, text=None, arguments=()):
        result = subprocess.run(["bash", "-euo", "pipefail", "-c", command, "bash", *arguments], cwd=self.folder, text=True,
                                input=text, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                timeout=PATIENCE, check=False)
        if result.returncode != 0:
            raise Wrong(f"status {result.returncode} of: {command}\n{result.stdout[-3000:]}")
        return result.stdout

    def sh(self, block):
        self.call(block.text)

    def console(self, block):
        for part in re.split(r"(?m)^\$ ", block.text)[1:]:
            command, expected = part.split("\n", 1)
            said = self.call(command)
            pattern = re.escape(expected.strip()).replace(r"\.\.\.", ".*")
            if expected.strip() and not re.fullmatch(pattern, said.strip(), re.S):
                raise Wrong(f"$ {command}\nprints\n{said}\nand not\n{expected}")

    def cpp(self, block):
        text = block.text
        if not re.search(r"\bmain\(", text):
            body = re.sub(r"(?m)^(?:#include .*|using .*;)$", "", text)
            text = "\n".join([*re.findall(r"(?m)^(?:#include .*|using .*;)$", text), "int main() {", body, "}\n"])
        text = re.sub(r"(?m)^int main\(", lambda main: block.marks.get("compiled with", "") + "\n" + main[0], text)
        if "rclcpp" in text:
            text = "#include <rclcpp/rclcpp.hpp>\n" + text
        self.call(f"{self.tools.cxx} -std=c++20 -x c++ -fsyntax-only -Wall -Wextra -Werror -Wno-unused-variable "
                  f"$(pkg-config --cflags redag) {' '.join(self.tools.ros)} -", text)

    def yaml(self, block):
        name = block.marks.get("file", f"line{block.line}.yaml")
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / name).write_text(block.text, encoding="utf-8")
        quoted = shlex.quote(name)
        if re.search(r"(?m)^experiment: ", block.text):
            small = re.sub(r"(?m)^(sets|repetitions): \d+", r"\1: 1", block.text)
            small = re.sub(r"(?m)^duration: \d+s", "duration: 10ms", small)
            (self.folder / name).write_text(small, encoding="utf-8")
            self.call(f"redag experiment {quoted} --out results_of_line{block.line}")
        elif re.search(r"(?m)^overheads:", block.text):
            self.call(f"redag analyze workloads/robot.yaml --overheads {quoted}")
        else:
            self.call(f"redag validate {quoted}")

    def cmake(self, block):
        if "file" not in block.marks:
            raise Wrong("a block of CMake is for a file: <!-- file: CMakeLists.txt -->")

    def xml(self, block):
        xml.etree.ElementTree.fromstring(block.text)

    def confirm(self, block):
        """Fails if the reason for not running a block names a check that is not there, or that runs something else."""
        for name in re.findall(r"[\w.-]*(?:/[\w.-]+)+", block.marks["not run"]):
            check = self.tools.source / name.rstrip(".")
            if not check.is_file():
                raise Wrong(f"the reason names {name}, which is not there")
            if block.language != "sh" or check.suffix not in ("", ".py"):
                continue
            text = check.read_text(encoding="utf-8")
            if "README.md" in text or "docs/ros2.md" in text:
                continue  # reads the commands from the page
            commands = [words for line in block.text.splitlines() if (words := line.split("#")[0].removeprefix("sudo ").split())]
            wanted = {words[1] if words[0] == "redag" and len(words) > 1 else pathlib.Path(words[0]).name for words in commands}
            if not any(word in text for word in wanted):
                raise Wrong(f"the reason names {name}, which runs none of {', '.join(sorted(wanted))}")

    def is_written(self, pattern, folders=("redag", "redag_analysis", "redag_lab", "ros", "tests")):
        """True if a source in these folders has this text (a regular expression)."""
        where = [self.tools.source / folder for folder in folders]
        return subprocess.run(["grep", "-rqsE", "--include=*.[ch]pp", "--", pattern, *where], check=False).returncode == 0

    def look_up(self, text):
        """Fails if commands name something that is not there."""
        def wanted(is_there, what):
            if not is_there:
                raise Wrong(f"the block is not run, and names {what}, which is not there")

        source = self.tools.source
        for line in text.replace("\\\n", " ").splitlines():
            words = shlex.split(line.removeprefix("$ "), comments=True)
            for at, word in enumerate(words):
                if word.startswith("redag "):  # in quotes
                    self.look_up(word)
                elif re.match(r"(tools|tests|workloads|evaluation|examples)/", word):
                    wanted((source / word).exists(), word)
                elif variable := re.match(r"(REDAG_\w+)=", word):
                    wanted(self.is_written(f'"{variable[1]}"'), variable[1])
                elif suite := re.match(r"--gtest_filter=(\w+)\.", word):
                    wanted(self.is_written(rf"^\w*(TEST|PROP)\w*\({suite[1]}\b"), suite[1])
                elif words[:1] == ["ros2"] and word in ("run", "launch") and words[at + 1].startswith("redag_"):
                    folder, program = source / "ros" / words[at + 1], words[at + 2]
                    built = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
                    wanted(re.search(rf"\b{program}\b", built) or (folder / "launch" / program).exists(), program)
                elif word == "-p" and ":=" in words[at + 1]:
                    wanted(self.is_written(f'"{words[at + 1].split(":=")[0]}"', ["ros/redag_rclcpp/src"]), words[at + 1])
                elif word == "redag" and at + 1 < len(words) and re.fullmatch(r"[a-z]+", words[at + 1]):
                    help_text = self.call(f"redag help {words[at + 1]}")
                    end = next((i for i in range(at, len(words)) if words[i] in ("|", "&&", ";")), len(words))
                    for option in words[at + 2:end]:
                        name = option.split("=")[0]
                        wanted(not name.startswith("--") or re.search(rf"{name}\b(?!-)", help_text), f"{name} of redag {words[at + 1]}")

    def execute(self, block):
        """Returns what was done with the block."""
        if block.language in NO_CODE:
            return "no code"
        if block.language not in ("sh", "console", "cpp", "yaml", "cmake", "xml"):
            raise Wrong(f"no rule for the language {block.language!r}")
        if "not run" in block.marks:
            self.confirm(block)
            if block.language == "sh":
                self.call('bash -n <<< "$1"', arguments=[block.text.replace("<this repository>", "repository")])
            if block.language in ("sh", "console"):
                self.look_up(block.text)
            return "not run"
        if block.language == "cpp" and "rclcpp" in block.text and not self.tools.ros:
            block.marks["not run"] = "there is no ROS 2 under /opt/ros"
            return "not run"
        if "run with" in block.marks:
            old, new = block.marks["run with"].split(" = ")
            if old not in block.text:
                raise Wrong(f"'run with' names {old!r}, which is not in the block")
            block = block._replace(text=block.text.replace(old, new))
        if "file" in block.marks:
            (self.folder / block.marks["file"]).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / block.marks["file"]).write_text(block.text, encoding="utf-8")
        getattr(self, block.language)(block)
        return {"sh": "executed", "console": "executed", "cpp": "compiled"}.get(block.language, "validated")


class Tools:
    """The program, and an installation of the build."""

    def __init__(self, program, source, build, cxx, cmake, scratch):
        self.program, self.source, self.cxx, self.prefix = program, source, cxx, scratch / "prefix"
        subprocess.run([cmake, "--install", build, "--prefix", self.prefix], check=True, stdout=subprocess.DEVNULL)
        self.pkgconfig = next(self.prefix.rglob("redag.pc")).parent
        # Headers of ROS 2, which the compiler takes as the system's, and of this repository's package for it.
        newest = sorted(pathlib.Path("/opt/ros").glob("*/include/rclcpp/rclcpp"))[-1:]
        # include/rclcpp/rclcpp, but not include/idl/endian.h of Cyclone DDS, which would hide the C library's.
        self.ros = [f"-isystem {folder}" for place in newest for folder in place.parents[1].iterdir()
                    if (folder / folder.name).is_dir()]
        if self.ros:
            self.ros += [f"-I{source / 'ros' / 'redag_rclcpp' / 'include'}", f"-I{self.prefix / 'include' / 'redag-internal'}"]


def main():
    if len(sys.argv) < 6:
        sys.exit(__doc__)
    program, source, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
    folders = ["*", "ros/*", "examples/*", "tests/*", "evaluation/*"]
    pages = sys.argv[6:] or [str(page.relative_to(source)) for page in sorted(
        {*source.glob("*.md"), *source.glob("docs/**/*.md"), *(page for each in folders for page in source.glob(each + "/README.md"))})]
    counts, reasons, failures = collections.Counter(), [], 0
    with tempfile.TemporaryDirectory() as name:
        tools = Tools(program, source, build, *sys.argv[4:6], pathlib.Path(name))
        for number, page in enumerate(pages):
            folder = pathlib.Path(name, f"page{number}")
            folder.mkdir()
            runner = Page(folder, tools, source)
            begin = time.monotonic()
            for block in blocks_of(page, source):
                try:
                    done = runner.execute(block)
                except (Wrong, OSError, ValueError, subprocess.TimeoutExpired, xml.etree.ElementTree.ParseError) as error:
                    print(f"{page}:{block.line}: {error}", flush=True)
                    failures += 1
                    continue
                counts[done] += 1
                if done == "not run":
                    reasons.append(f"{page}:{block.line}: {block.marks['not run']}")
            print(f"{page}: {time.monotonic() - begin:.1f} s", flush=True)
    print("Not run:", *reasons, sep="\n  ")
    print(", ".join(f"{count} {done}" for done, count in sorted(counts.items())), f"and {failures} failed")
    if failures or not sys.argv[6:] and counts["executed"] < 10:
        sys.exit(1)


if __name__ == "__main__":
    main()
