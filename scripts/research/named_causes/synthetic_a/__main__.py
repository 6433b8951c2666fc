"""`python -m scripts.research.named_causes.synthetic_a`: write one world as files."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from scripts.research.named_causes.synthetic_a.catalogue import LABELS
from scripts.research.named_causes.synthetic_a.conventions import PLANES_DEG
from scripts.research.named_causes.synthetic_a.world import ELEVATIONS_DEG, make_world


def main(arguments: Sequence[str] | None = None) -> None:
    """Write one simulated world: a motion file and, separately, the truth."""
    parser = argparse.ArgumentParser(description="Simulate subjects with a hidden effect, their truth apart.")
    parser.add_argument("label", help=f"{', '.join(LABELS)}; or two joined by '+'")
    parser.add_argument("--model", type=Path, required=True, help="parameter set, TOML")
    parser.add_argument("--out", type=Path, required=True, help="motion file, CSV")
    parser.add_argument("--truth", type=Path, required=True, help="truth, JSON")
    parser.add_argument("--subjects", type=int, default=10)
    parser.add_argument("--noise-deg", type=float, default=1.5, help="SD of the noise on each angle")
    parser.add_argument("--size", type=float, default=1.0, help="factor on the effect's amplitude")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--motions", nargs="+", choices=tuple(PLANES_DEG), default=["abduction", "forward_flexion"])
    parser.add_argument("--elevations", type=float, nargs="+", default=list(ELEVATIONS_DEG), help="of the humerus, deg")
    parser.add_argument("--mixed-sign", action="store_true", help="draw the effect's sign for each subject")
    parser.add_argument("--landmarks", action="store_true", help="add SC, AC, TS and AI in the thorax frame, mm")
    given = vars(parser.parse_args(arguments))
    out, truth, model = given.pop("out"), given.pop("truth"), given.pop("model")
    try:
        world = make_world(model_toml_path=model, **given)
    except (ValueError, OSError) as error:
        parser.error(str(error))
    world.table.to_csv(out, index=False, float_format="%.4f")
    truth.write_text(json.dumps(world.truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
