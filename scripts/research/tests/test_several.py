"""Precision and recall in worlds with several causes, against counts by hand."""

from typing import Any

from scripts.research.named_causes.blind.several import several_report

OTHER = "ac_translation"
"""Cause that is not active in any of the worlds."""


def line(label: str, *causes: list[str], **inclusion: float) -> dict[str, Any]:
    answer = "effect" if causes else "none"
    return {
        "label": label,
        "answer": answer,
        "causes": list(causes),
        "inclusion": inclusion,
        "left_over_share": 0.5,
        "true_directions": {},
    }


def test_precision_recall_and_what_is_blamed_on_nothing() -> None:
    report = several_report(
        [
            line("none"),
            line("none", ["thorax_tilt"]),
            line("conoid_strain+skin_artefact", ["skin_artefact"], [OTHER, "conoid_strain"], skin_artefact=1.0),
            line("conoid_strain", [OTHER], conoid_strain=0.0),
            line("outside_fog", [OTHER]),
        ]
    )
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in report.splitlines() if row]
    rows = {name: values for name, *values in cells}

    def numbers(name: str) -> list[str]:
        return [value.split(" ")[0] for value in rows[name]]

    assert numbers("worlds") == ["2", "1", "1", "4"]
    assert numbers("causes named that are at work (precision)") == ["0.0", "0.0", "100.0", "50.0"]
    assert numbers("causes at work that are found (recall)") == ["-", "0.0", "100.0", "66.7"]
    assert rows["nothing at work: one blamed"][0].startswith("50.0 %")
    assert rows["names of a cause that is right"][-1] == "1.50 (2)"
    assert numbers("calibration error of 'at work'")[1:3] == ["1.000", "0.000"]
    assert numbers("conoid_strain") == ["50.0", "-", "100.0"]
    assert rows["share left over: told"] == ["-"] * 4


def test_the_share_left_over_beside_the_true_one() -> None:
    told = [(0.5, 0.45), (0.5, 0.25), (float("nan"), 0.3)]
    lines = [line("conoid_strain") | {"left_over_share": one, "true_left_over_share": true} for one, true in told]
    report = several_report(lines)
    assert "| share left over: told | 0.50 (2) |" in report
    assert "| share left over: true | 0.35 (2) |" in report
    assert "| share left over: told within 20 % of the true | 50.0 %" in report
