"""Read the reference of the Python API, docs/site/api.md, for the names that it documents."""

import re

from scripts.rooms import ROOT


def documented_names() -> set[str]:
    """Return the documented names with their packages."""
    text = (ROOT / "docs" / "site" / "api.md").read_text(encoding="utf-8")
    parts = re.findall(r"currentmodule:: (\S+)\n(.*?)```", text, re.DOTALL)
    return {f"{module}.{name}" for module, names in parts for name in re.findall(r"^\.\. \S+:: (\w+)", names, re.M)}
