"""How `make docs` builds these pages, with Sphinx and MyST: they stay plain Markdown, and any warning is an error."""

import re
from typing import Any

project = "EDF Stitch"
author = copyright = "EDF Stitch maintainers"
extensions = ["myst_parser"]
root_doc = "index"
exclude_patterns = ["conf.py"]
# Headings are linked as where the code is read.
myst_heading_anchors = 3
html_theme = "alabaster"
html_theme_options = {"description": "Photographs with parallax, stitched into one picture", "page_width": "1100px"}


def setup(app: Any) -> None:
    """Sphinx calls this."""
    app.connect("source-read", _as_site)


def _as_site(_app: Any, name: str, source: list[str]) -> None:
    """The pages that the map names become the contents; what lies beside docs/ is named, and not part of the site."""
    if name == "index":
        pages = re.findall(r"\]\((\w[\w-]*)\.md\)", source[0])
        source[0] += "\n```{toctree}\n:hidden:\n\n" + "\n".join(dict.fromkeys(pages)) + "\n```\n"
    source[0] = re.sub(r"\[([^]]*)\]\(\.\./[\w.]+\)", r"\1", source[0])
