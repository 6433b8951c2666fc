"""How many corrupted trials are named, how many pass in silence, and how many correct trials raise an alarm?

    .venv/bin/python scripts/research/landmarks/study_corrupted.py --trials 2000 --seed 1

A trial counts where its fault changes an angle by more than 5 degrees in a frame. The fault is "named" where a message
names one of the faulty landmarks, or the sign; "alone" where no message names a correct landmark as well; "silent"
where the fault is not named and a posture in the output has such an error.
"""

import argparse
import re
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.random import Generator, SeedSequence, default_rng

from motions import ANGLES, InputError, Motions
from motions.checks.at_rest import warn_of_subjects
from motions.errors import InputWarning
from motions.landmarks.girdle_angles import frame_angles
from motions.landmarks.mapping import MARKERS
from motions.landmarks.sampled_postures import SLIPPED, Labels, postures_from_landmarks
from motions.motion_csv.cells import Side
from scripts.research.landmarks.corrupted_trials import FAULTS, corrupted_trial, sound_trial

LARGE_DEG = 5.0
KINDS = (*FAULTS, "swap", "mirrored")
SIGNS = (
    ("scapula_z",),
    ("clavicle_z",),
    ("clavicle_z", "scapula_z"),
    ("clavicle_x",),
    ("scapula_x",),
    ("clavicle_y",),
    ("scapula_y",),
)
COUNTED = ("named", "alone", "silent")

NOISE_DEG = 1.5
"""SD of the noise of an angle in trials with reversed signs."""

_COMPARED = [0, 1, 3, 4, 5, 6]

_BLAMES = re.compile(
    r": ((?:[A-Z0-9]{2}(?: or | and )?)+) (?:cannot be right|(?:is|are) not in its place|slipped in)"
    r"|landmark ([A-Z0-9]{2}) (?:was never seen|is at)|labels of (.*?) are exchanged|Are (.*?) swapped"
)


@dataclass(frozen=True)
class Result:
    """Outcome of one trial."""

    kind: str
    noise: float
    counts: bool
    named: bool
    alone: bool
    silent: bool
    said: str


def messages(lab_mm, side: Side, at_deg: tuple[float, ...] = ()) -> tuple[list[str], Motions | None]:
    """Convert a trial; return all messages, and the motions if the conversion succeeded."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        try:
            found = postures_from_landmarks(lab_mm, Labels("P", "m", side, at_deg), "t")
            said = []
        except InputError as error:
            found, said = None, [str(error)]
    said = [str(one.message) for one in caught if issubclass(one.category, InputWarning)] + said
    if found is not None and SLIPPED in found.extra:
        said += [f": {name} slipped in {k}" for k, names in enumerate(found.extra[SLIPPED]) for name in names.split()]
    return said, found


def blamed(said: list[str]) -> set[str]:
    """Return the landmarks that the messages blame."""
    found = [word for text in said for match in _BLAMES.findall(text) for part in match for word in part.split()]
    return set(found) & set(MARKERS)


def errors_deg(found: Float[np.ndarray, "frames 7"], true: Float[np.ndarray, "frames 7"]):
    """Compute the largest error of an angle in each frame, except the clavicle's axial rotation, an estimate."""
    turned = np.abs((found - true + 180.0) % 360.0 - 180.0)
    return np.nanmax(np.where(np.isnan(turned), 0.0, turned)[:, _COMPARED], axis=1)


def angles_of(lab_mm, side: Side) -> Float[np.ndarray, "frames 7"] | None:
    """Compute the six angles and the elevation, checking only the side; None where that check refuses the trial."""
    try:
        with np.errstate(all="ignore"):
            found = frame_angles(lab_mm, side, "t")
    except InputError:
        return None
    return np.concatenate([found.angles_deg, found.humerus_deg[:, 1:2]], axis=1)


def judge(rng: Generator, kind: str) -> Result:
    """Corrupt a trial, convert it, and compare the messages and angles with the truth."""
    one = corrupted_trial(rng, kind)
    true, changed = angles_of(one.sound_mm, one.side), angles_of(one.lab_mm, one.side)
    assert true is not None
    counts = changed is None or errors_deg(changed, true).max() > LARGE_DEG
    said, found = messages(one.lab_mm, one.side)
    blame = blamed(said)
    wrong = found is not None and _is_wrong(found, true)
    named = bool(blame & set(one.wrong)) or (kind == "mirrored" and any("left-handed" in text for text in said))
    named = named or (kind == "zero" and not wrong)  # as in any other gap of the recording, the angles are empty
    alone = kind == "mirrored" or blame <= set(one.wrong)
    return Result(
        kind, one.noise_mm, bool(counts), named, alone, wrong and not named, f"{one.wrong} {one.frames} {said}"
    )


def _is_wrong(found: Motions, true: Float[np.ndarray, "frames 7"]) -> bool:
    """Check whether a posture in the output has an angle that is wrong by more than LARGE_DEG."""
    written = np.concatenate([found.angles_deg, found.humerus_elevation_deg[:, None]], axis=1)
    return bool(errors_deg(written, true[found.posture - 1]).max() > LARGE_DEG)


def judge_signs(rng: Generator, angles: tuple[str, ...]) -> Result:
    """Reverse the signs of some angles of a trial with noise, and check whether the messages name them."""
    motions = _angles(rng)
    flip = np.where(np.isin(ANGLES, angles), -1.0, 1.0)
    turned = Motions(**{**vars(motions), "angles_deg": motions.angles_deg * flip})
    said = _said_of(turned)
    change = np.abs(2.0 * motions.angles_deg[:, flip < 0.0]).max() > LARGE_DEG
    named = all(any(f"{angle}_deg" in text for text in said) for angle in angles)
    beside = {angle for angle in ANGLES for text in said if f"{angle}_deg (" in text} - set(angles)
    return Result(f"sign {' '.join(angles)}", NOISE_DEG, bool(change), named, not beside, not named, " | ".join(said))


def _angles(rng: Generator) -> Motions:
    while True:
        sound = sound_trial(rng, False)
        if sound.lab_mm["IJ"].shape[1] == 12:
            _, found = messages(sound.lab_mm, sound.side)
            assert found is not None
            noise = NOISE_DEG * rng.standard_normal(found.angles_deg.shape)
            return Motions(
                **{**vars(found), "angles_deg": found.angles_deg + noise, "landmarks_mm": {}, "extra": found.extra[[]]}
            )


def _said_of(motions: Motions) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        warn_of_subjects(motions, "t")
    return [str(one.message) for one in caught]


def corrupted_results(trials: int, seed: int) -> Iterator[Result]:
    """Judge so many trials, cycling through the kinds; a trial depends on its number and the seed alone."""
    every = (*KINDS, *SIGNS)
    for k, part in enumerate(SeedSequence(seed).spawn(trials)):
        kind, rng = every[k % len(every)], default_rng(part)
        yield judge(rng, kind) if isinstance(kind, str) else judge_signs(rng, kind)


def sound_alarms(trials: int, seed: int, at_deg: tuple[float, ...] = ()) -> dict[float, list[str]]:
    """Convert correct trials; return the messages of each, by noise; the text is empty where there is no message."""
    found: dict[float, list[str]] = {}
    for k, part in enumerate(SeedSequence(seed).spawn(trials)):
        rng = default_rng(part)
        sound = sound_trial(rng, bool(k % 3 == 0))
        said, _ = messages(sound.lab_mm, sound.side, at_deg)
        found.setdefault(sound.noise_mm, []).append(" | ".join(text for text in said if "no posture at" not in text))
    return found


def table(results: list[Result]) -> pd.DataFrame:
    """Count the outcomes by kind, over the trials whose fault changes an angle."""
    rows = []
    for kind in [*dict.fromkeys(one.kind for one in results), "all"]:
        mine = [one for one in results if one.counts and kind in (one.kind, "all")]
        share = {
            f: np.mean([getattr(one, f) for one in mine]) if mine else np.nan for f in ("named", "alone", "silent")
        }
        rows.append({"kind": kind, "trials": len(mine)} | {f: f"{100.0 * v:.1f} %" for f, v in share.items()})
    return pd.DataFrame(rows)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", type=int, default=0, help="of the trials that were not named, so many messages")
    arguments = parser.parse_args()
    results = list(corrupted_results(arguments.trials, arguments.seed))
    print(table(results).to_string(index=False))
    for one in [one for one in results if one.counts and not (one.named and one.alone)][: arguments.show]:
        print(one)
    for at_deg in ((), (30.0, 60.0, 90.0)):
        alarms = sound_alarms(arguments.trials // 4, arguments.seed, at_deg)
        print(f"sound trials, --at {at_deg}:")
        for noise, said in sorted(alarms.items()):
            print(f"  {noise} mm: {sum(map(bool, said))} of {len(said)} raise an alarm")
            for text, count in Counter(filter(None, said)).most_common(arguments.show):
                print("   ", count, text)


if __name__ == "__main__":
    main()
