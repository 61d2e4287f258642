# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Settings of Sphinx for the documentation site, which tools/build_site builds. The pages are those of the repository."""
import os
import pathlib
import re
import sys
import xml.etree.ElementTree

from docutils import nodes
from sphinx import addnodes

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.environ["REDAG_SOURCE"], "docs", "site"))
import furo_of_debian  # noqa: E402

# tools/build_site copies the pages, in the repository's folders, to where this file is read from.
REPOSITORY = pathlib.Path(os.environ["REDAG_SOURCE"])
PACKAGE = xml.etree.ElementTree.parse(REPOSITORY / "redag" / "package.xml").getroot()
# Where a link to a source file or folder leads: REDAG_SOURCE_URL, or the repository that package.xml states.
SOURCE_URL = os.environ.get("REDAG_SOURCE_URL") or next(
    url.text for url in PACKAGE.findall("url") if url.get("type") == "repository") + "/tree/main"

project = "ReDAG-RT"
author = "The ReDAG-RT developers"
project_copyright = author
release = version = PACKAGE.findtext("version")

extensions = ["myst_parser"]
myst_heading_anchors = 5
myst_update_mathjax = False
root_doc = "index"
highlight_language = "text"  # of a block without a language: the output of a command
smartquotes = False  # would turn --option into another character
nitpicky = True

html_theme = "furo"
html_title = f"ReDAG-RT {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None


def link_sources(app, document):
    """Makes a link to a file that is no page lead to the repository. One to a missing file stays, and is an error."""
    folder = (REPOSITORY / app.env.docname).parent
    links = [*document.findall(addnodes.pending_xref), *document.findall(addnodes.download_reference)]
    for link in links:
        target = link["reftarget"].split("#")[0]
        if re.match(r"[a-z]+:", target) or not target:
            continue
        path = (folder / target).resolve()
        if not path.exists() or not path.is_relative_to(REPOSITORY):
            continue
        name = str(path.relative_to(REPOSITORY))
        if path.suffix == ".md" and os.path.splitext(name)[0] in app.env.found_docs:
            continue
        url = SOURCE_URL if name == "." else f"{SOURCE_URL}/{name}"
        reference = nodes.reference("", "", internal=False, refuri=url)
        reference += link.children
        link.replace_self(reference)


def setup(app):
    app.connect("doctree-read", link_sources)
    app.connect("build-finished", furo_of_debian.complete)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
