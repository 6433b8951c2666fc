"""From a trial (.trc) to a report: read the trial and adapt the model to its subject. The trial is simulated.

On the command line: `girdle convert P01.trc P01.csv --subject P01 --motion abduction --at 10,30,50,70,90,110,130`, then
`girdle adapt P01.csv --model R2 --out results`.
"""

from dataclasses import replace
from pathlib import Path

from simulated_trial import write_trc

from adapt import adapt_subjects
from adapt.report import report_html
from models import load_model
from motions import read_trial


def main(folder: Path) -> Path:
    """Write the trial and its report into a folder."""
    trial = write_trc(folder / "P01.trc")  # replace this with a trial of your own
    motions = read_trial(trial, subject="P01", motion="abduction", at_deg=range(10, 131, 20))
    motions = replace(motions, extra=motions.extra.assign(origin="simulated"))  # the report then says "simulated"

    models = [load_model("R2")]
    result = adapt_subjects(motions, models)
    everything = result.summary.query("subject == 'P01' and motion == 'all'")
    print(everything[["adapted", "clavicle_deg", "scapula_deg"]].to_string(index=False))

    report = folder / "report.html"
    report.write_text(report_html(motions, models, result), encoding="utf-8")
    print(f"open {report}")
    return report


if __name__ == "__main__":
    main(Path("out/examples/trc_to_report"))
