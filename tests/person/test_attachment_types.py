"""The five types of Table 5.3, on the rows of Appendix D."""

import re
from pathlib import Path

import pytest

from models.person.transfer.attachment_types import CROSS, LARGE, SHIFT, SLIDE, SMALL, attachment_type

THESIS = Path(__file__).parents[3] / "shared" / "thesis.txt"
ROW = re.compile(r"^R2\d?-R2\d\s+([\d.]+)\s+([\d.]+)\s+([\d.]+)\s+(SMALL|LARGE|T[123])\b", re.MULTILINE)


@pytest.mark.parametrize(
    ("distances", "kind"),
    [
        ((0.5, 4.2, 10.7), SMALL),
        ((8.3, 11.2, 14.6), LARGE),
        ((0.3, 6.3, 15.5), SLIDE),
        ((7.8, 8.9, 11.2), SHIFT),
        ((0.2, 8.3, 33.6), CROSS),
        ((5.0, 7.0, 12.0), SMALL),
        ((6.0, 6.5, 13.0), None),
    ],
)
def test_each_type(distances, kind):
    assert attachment_type(*distances) == kind


def test_distances_out_of_order():
    with pytest.raises(ValueError, match="not in order"):
        attachment_type(3.0, 2.0, 5.0)


def test_every_row_of_appendix_d_has_its_printed_type():
    if not THESIS.exists():
        pytest.skip(f"no text of the thesis in {THESIS}: it is not part of the project")
    text = THESIS.read_text(encoding="utf-8")
    rows = ROW.findall(text[text.index("Table D.2") :])
    wrong = [row for row in rows if attachment_type(*map(float, row[:3])) != row[3]]
    assert len(rows) == 84
    assert not wrong
    limits = (5.0, 7.0, 12.0)
    on_a_limit = [row for row in rows if any(float(x) == limit for x, limit in zip(row[:3], limits, strict=True))]
    assert len(on_a_limit) == 1  # the one that the printed "<" and ">" leave without a type: 83 have one
    assert {row[3] for row in rows} == {SMALL, LARGE, SLIDE, SHIFT, CROSS}
