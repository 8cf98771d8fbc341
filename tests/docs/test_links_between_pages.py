"""Links between the pages."""

from __future__ import annotations

import re

import pytest

from .conftest import DOCS


@pytest.mark.parametrize("page", sorted(page.name for page in DOCS.glob("*.md")))
def test_links_lead_somewhere(page: str) -> None:
    """Every relative link of a page leads to a file that is there."""
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", (DOCS / page).read_text("utf-8"))
    assert [target for target in targets if not (DOCS / target).exists()] == []
