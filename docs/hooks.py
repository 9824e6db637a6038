"""Puts the generated parts into the pages: ``<!-- generated: settings -->``."""

from __future__ import annotations

import re
from typing import Any

from ballsim.reference import PARTS

_MARK = re.compile(r"<!-- generated: (\w+) -->")


def on_page_markdown(markdown: str, **_others: Any) -> str:
    """Replace the marks of a page.

    Args:
        markdown: The page.
    """
    return _MARK.sub(lambda match: PARTS[match[1]](), markdown)
