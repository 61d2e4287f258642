#!/usr/bin/env python3
# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Checks the bundle of ECharts against its package files: version, notices, and no text that would end a <script>.

Usage: echarts_test.py FOLDER. `redag_lab/third_party/echarts/build --check` compares every byte; it needs npm.
"""
import json
import pathlib
import sys

folder = pathlib.Path(sys.argv[1])
bundle = (folder / "echarts.min.js").read_text(encoding="ascii")
wanted = json.loads((folder / "package.json").read_text())["devDependencies"]["echarts"]
packages = json.loads((folder / "package-lock.json").read_text())["packages"]
locked = packages["node_modules/echarts"]["version"]
zrender = packages["node_modules/zrender"]["version"]

problems = []
if wanted != locked:
    problems.append(f"package.json wants ECharts {wanted}, the lock file has {locked}")
if not bundle.startswith(f"/*! Apache ECharts {locked} ") or f"with ZRender {zrender}," not in bundle:
    problems.append(f"the bundle is not ECharts {locked} with ZRender {zrender}: run redag_lab/third_party/echarts/build")
if f'"{locked}"' not in bundle:
    problems.append(f"the bundle's code does not know the version {locked}: the banner alone was changed")
for name in ("NOTICE", "LICENSE.zrender", "LICENSE.d3"):
    if (folder / name).read_text().strip() not in bundle:
        problems.append(f"the bundle lacks {name}")
for text in ("</script", "<!--"):
    if text in bundle.lower():
        problems.append(f"the bundle contains {text!r}, which would end the element that holds it")
for problem in problems:
    print(f"echarts_test: {problem}")
sys.exit(1 if problems else 0)
