# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Completes the files of Debian's furo in a finished site. Debian has no bundler for it, and so its package lacks three
things: the reset of styles that it imports from a path of the web server, one script instead of two modules, and the
dark colours for a reader whose system is dark. Files that are whole, as furo's own releases are, stay as they are."""
import pathlib
import re

RESETS = pathlib.Path("/usr/share/javascript")


def complete_styles(text):
    def reset(found):
        return (RESETS / found[1]).read_text(encoding="utf-8")
    text = re.sub(r"@import url\(/javascript/([^)]+)\);", reset, text)
    if "prefers-color-scheme" not in text:
        dark = re.search(r'body\[data-theme="dark"\] (\{[^}]*\})', text)[1]
        text += '\n@media (prefers-color-scheme: dark) { body[data-theme="auto"] ' + dark + " }\n"
    return text


def complete_script(folder):
    script = folder / "furo.js"
    text = script.read_text(encoding="utf-8")
    module = re.match(r'import Gumshoe from "\./([\w.-]+)";\n', text)
    if module:  # the other one defines Gumshoe for all scripts of a page
        imported = (folder / module[1]).read_text(encoding="utf-8")
        script.write_text(imported + "\n" + text[module.end():], encoding="utf-8")


def complete(app, error):
    """Handles Sphinx's event build-finished."""
    if error or app.builder.name != "html":
        return
    static = pathlib.Path(app.outdir, "_static")
    styles = static / "styles" / "furo.css"
    styles.write_text(complete_styles(styles.read_text(encoding="utf-8")), encoding="utf-8")
    complete_script(static / "scripts")
