"""Assignment of markers to landmarks: a first guess, and the mapping file for ``girdle convert``."""

from collections.abc import Iterable, Mapping

from models.export.toml import toml_text
from motions.landmarks.mapping import MARKERS

HEADING = "Which marker is which landmark, unit"

_CONTROLS: Mapping[str, str] = {
    "in a mapping file (--map)": f'below, under "{HEADING}"',
    "--sc-from-ij": '"SC from IJ"',
    "--aa-to-ac": '"AC from AA"',
}


def guessed(names: Iterable[str]) -> dict[str, str]:
    """Find the landmarks that are among the marker names, with or without a prefix, as ``P01:IJ``."""
    found = {}
    for landmark in MARKERS:
        ends = {name for name in names if name.rpartition(":")[2].strip().upper() == landmark}
        exact = {landmark} & ends
        if len(exact or ends) == 1:
            (found[landmark],) = exact or ends
    return found


def pointing_here(text: str) -> str:
    """Replace options and mapping file in a message of ``girdle convert`` by the controls of the page.

    Messages about settings without a control (axes, columns, clusters) keep the words of the command line.
    """
    if "axes =" in text or "under [" in text:
        return text
    for of_command, of_page in _CONTROLS.items():
        text = text.replace(of_command, of_page)
    return text


def mapping_toml(markers: Mapping[str, str], unit: str = "") -> str:
    """Write the mapping file. ``markers``: marker name or formula by landmark; empty ones are left out."""
    lines = [f"unit = {toml_text(unit)}"] if unit else []
    lines += ["[markers]", *(f"{landmark} = {toml_text(name)}" for landmark, name in markers.items() if name)]
    return "\n".join(lines) + "\n"
