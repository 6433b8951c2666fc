"""Figures of the withheld-effect check from the result lines of its cases: rates with intervals, as Markdown.

An answer names causes, each by one name or by several that the data cannot tell apart. A "confident wrong name" is an
answer with one name for each cause and without the active effect; where the active effect is outside the list, it is
every answer with one name for each cause.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from adapt.diagnosis.result import EFFECT, NONE, UNKNOWN
from models.effects import EFFECTS
from scripts.reporting import markdown, wilson
from scripts.research.named_causes.blind.cases import ALONE, LISTED, kind
from scripts.research.named_causes.blind.runs import Line, key

CAUSES = tuple(dict.fromkeys(effect.cause for effect in EFFECTS.values()))
"""Causes that can be named, whatever their basis."""

_BINS = 10
_DRAWS = 1000
_LEAST_PROBABILITY = 1e-6
"""Lower limit of a probability in the log score: one "impossible" case must not outweigh all others."""

_SURE = 0.9

_MOST_CONFUSIONS = 12
_MOST_FAILURES = 10

COULD_BE_FOUND = "could be found: alone in the library it is named"
LESS_THAN_COULD = "less than could be found by"
SHRINKAGE_ALONE = "the same, with the effect at work alone in the library"

REACH = {
    LESS_THAN_COULD: "<= 5 points",
    "true effect in the reported set, of answers 'effect'": ">= 95 %",
    "mean number of names of a cause": "<= 1.5",
    "effect at work: confident wrong name": "<= 3 %",
    "no effect: one blamed": "<= 3 %",
    "outside: unknown": ">= 90 %",
    "outside: confident wrong name": "<= 3 %",
    "calibration error of 'at work'": "<= 0.05",
    "at work, of those that are with 0.9 or more": ">= 90 %",
    "ECE of the probabilities": "<= 0.05",
    "amplitude intervals that cover": "92-97 %",
    "error of the predicted shrinkage: median, 90 %": "<= 2, 5 points",
}
"""Aim of each measure, in every condition."""


# Statistics ---------------------------------------------------------------------------------------------------------


def rate(hits: Iterable[bool]) -> str:
    """Format a share with its Wilson interval and the count."""
    hit = list(hits)
    if not hit:
        return "-"
    low, high = wilson(sum(hit), len(hit))
    return f"{100 * sum(hit) / len(hit):.1f} % ({100 * low:.0f}-{100 * high:.0f}; {len(hit)})"


def expected_calibration_error(confidence: Sequence[float], right: Sequence[bool]) -> float:
    """Compute the mean over cases of |share right - mean confidence| of the case's bin, with ten equal bins."""
    sure, hit = np.asarray(confidence), np.asarray(right, dtype=float)
    at = np.minimum((sure * _BINS).astype(int), _BINS - 1)
    return float(sum(abs((hit - sure)[at == b].sum()) for b in range(_BINS)) / len(sure))


def error_by_chance(confidence: Sequence[float]) -> float:
    """Compute the expected calibration error of so many cases if every confidence is right: the mean of many draws."""
    sure, generator = np.asarray(confidence), np.random.default_rng(0)
    draws = generator.random((_DRAWS, len(sure))) < sure
    return float(np.mean([expected_calibration_error(confidence, right) for right in draws.tolist()]))


def said_at_work(lines: Iterable[Line]) -> list[tuple[float, bool]]:
    """List, for every candidate of every line, its inclusion probability and whether it is active."""
    return [(p, name in at_work(line)) for line in lines for name, p in line["inclusion"].items()]


def calibration(lines: Iterable[Line]) -> str:
    """Format the calibration error of the inclusion probabilities, the error expected by chance, and their number."""
    answers = said_at_work(lines)
    if not answers:
        return "-"
    sure, right = zip(*answers, strict=True)
    return f"{expected_calibration_error(sure, right):.3f} ({error_by_chance(sure):.3f} by chance; {len(answers)})"


def surely_at_work(lines: Iterable[Line]) -> str:
    """Format how often candidates with an inclusion probability of ``_SURE`` or more are active."""
    return rate(right for p, right in said_at_work(lines) if p >= _SURE)


def named(line: Line) -> bool:
    """Check whether the answer names effects."""
    return line["answer"] == EFFECT


def names_of(line: Line) -> list[str]:
    """List every name of every cause, whatever the answer."""
    return [name for names in line["causes"] for name in names]


def best(line: Line) -> list[str]:
    """List the first name of every cause."""
    return [names[0] for names in line["causes"]]


def at_work(line: Line) -> set[str]:
    """Return the active effects, also an effect outside the list."""
    return set(line["label"].split("+"))


def covered(line: Line) -> bool:
    """Check whether the active effect is among the names of a cause."""
    return named(line) and line["label"] in names_of(line)


def first(line: Line) -> str:
    """Return the first name of the first cause, or the answer 'none' or 'unknown'."""
    return best(line)[0] if named(line) else line["answer"]


def confidently_wrong(line: Line) -> bool:
    """Check whether an answer has one name for each cause and none of them is active."""
    sure = named(line) and all(len(names) == 1 for names in line["causes"])
    return sure and not set(names_of(line)) & at_work(line)


def one_too_many(line: Line) -> bool:
    """Check whether a cause is named that is not active, beside or instead of the active one."""
    return named(line) and any(not set(names) & at_work(line) for names in line["causes"])


def most_probable_effect(line: Line) -> str:
    """Return the most probable of the listed effects, whatever the answer."""
    return max(CAUSES, key=lambda name: line["probability"].get(name, 0.0))


def surest(line: Line) -> tuple[float, bool]:
    """Return the largest probability of the line, and whether it belongs to the truth."""
    name = max(line["probability"], key=line["probability"].__getitem__)
    return line["probability"][name], name == truth_of(line)


def truth_of(line: Line) -> str:
    """Return the right answer; an effect outside the list is "unknown"."""
    return UNKNOWN if kind(line["label"]) == "outside" else line["label"]


def mean_of(values: Sequence[float]) -> str:
    """Format mean and number of values; a dash where there are none."""
    return f"{np.mean(values):.2f} ({len(values)})" if values else "-"


def log_score(lines: Iterable[Line]) -> str:
    """Compute the mean log probability of the truth; unlike the calibration error, it rewards sure right answers."""
    found = [math.log(max(line["probability"][truth_of(line)], _LEAST_PROBABILITY)) for line in lines]
    return mean_of(found)


def intervals_that_cover(lines: Iterable[Line]) -> list[bool]:
    """Check which amplitude intervals hold the true mean, for every direction of a rightly named effect.

    Directions without a known true mean, or without an interval because no gap shows them, are left out.
    """
    return [
        interval["low"] <= true[direction] <= interval["high"]
        for line in lines
        if named(line)
        for name, true in line["true_directions"].items()
        if name in at_work(line) & set(names_of(line))
        for direction, interval in line["amplitude"][name].items()
        if direction in true and interval["low"] is not None
    ]


def shrinkages(lines: Iterable[Line], predicted: str = "unseen_deg") -> list[tuple[float, float]]:
    """List predicted and realised shrinkage of the gap, as shares of the adapted gap."""

    def shrinkage(adapted: float, with_effect: float) -> float:
        return (adapted - with_effect) / adapted

    found = [(line[predicted], line["realised_deg"]) for line in lines if "realised_deg" in line and line[predicted]]
    return [
        (shrinkage(p["adapted"]["value"], p["with_effect"]["value"]), shrinkage(r["adapted"], r["with_effect"]))
        for p, r in found
    ]


def mimics(lines: Iterable[Line]) -> dict[tuple[str, int], set[str]]:
    """Collect, by label and seed, the names that the diagnosis with the whole list cannot tell from the effect."""
    return {
        (line["label"], line["seed"]): {
            name for group in line["indistinguishable"] if line["label"] in group for name in group
        }
        for line in lines
        if line["condition"] == "standard"
    }


def left_out_outcome(line: Line, like: dict[tuple[str, int], set[str]]) -> str:
    """Classify the answer for an effect that was not in the library."""
    if not named(line):
        return line["answer"]
    known = like.get((line["label"], line["seed"]))
    if known is None:
        return "a name; not judged, `standard` not run"
    if known & set(names_of(line)):
        return "honest mimic"
    return "confident wrong name" if confidently_wrong(line) else "wrong set"


def mimicry(left_out: Iterable[Line], whole: Iterable[Line]) -> np.ndarray:
    """Collect gaps on the held-out motion, deg, per world: [adapted, with the active effect, with the wrong name].

    The worlds are those with a wrong name while the active effect was not in the library, and the right name with it.
    """

    def realised(lines: Iterable[Line]) -> dict[tuple[str, int], dict[str, float]]:
        return {(line["label"], line["seed"]): line["realised_deg"] for line in lines if "realised_deg" in line}

    right, wrong = realised(line for line in whole if line["label"] in best(line)), realised(left_out)
    both = [(right[world], wrong[world]) for world in wrong if world in right]
    return np.array([(a["adapted"], a["with_effect"], b["with_effect"]) for a, b in both]).reshape(-1, 3)


def pair_outcome(line: Line) -> str:
    """Classify the answer for two effects at once."""
    if not named(line):
        return line["answer"]
    found = at_work(line) & set(names_of(line))
    apart = sum(bool(set(names) & found) for names in line["causes"])
    return ("wrong", "one named", "both named")[min(len(found), apart)]


def confusions(lines: Iterable[Line]) -> list[tuple[str, str, int, int]]:
    """Count confusions: (active effect, name, times beside it, times instead of it), the most frequent first."""
    beside, instead = Counter(), Counter()
    for line in lines:
        if kind(line["label"]) == "effect" and named(line):
            which = beside if covered(line) else instead
            which.update((line["label"], name) for name in names_of(line) if name != line["label"])
    order = sorted(beside | instead, key=lambda pair: (-beside[pair] - instead[pair], pair))
    return [(*pair, beside[pair], instead[pair]) for pair in order]


# Markdown -----------------------------------------------------------------------------------------------------------


def _of_the_surest(lines: Iterable[Line], error: Callable[[Sequence[float], Sequence[bool]], float]) -> str:
    sure = [surest(line) for line in lines]
    return f"{error(*zip(*sure, strict=True)):.3f} ({len(sure)})" if sure else "-"


def _mean_size(lines: Iterable[Line]) -> str:
    sizes = [len(names) for line in lines if named(line) for names in line["causes"]]
    return mean_of(sizes)


def _shrinkage_error(lines: Iterable[Line], predicted: str = "unseen_deg") -> str:
    found = np.array(shrinkages(lines, predicted))
    if not len(found):
        return "-"
    median, most = np.percentile(100 * np.abs(found[:, 0] - found[:, 1]), [50, 90])
    return f"{median:.1f}, {most:.1f} points ({len(found)})"


MEASURES: dict[str, tuple[str, Callable[[list[Line]], str]]] = {
    "true effect in the reported set": ("effect", lambda lines: rate(map(covered, lines))),
    "true effect in the reported set, of answers 'effect'": (
        "effect",
        lambda lines: rate(covered(line) for line in lines if named(line)),
    ),
    "mean number of names of a cause": ("effect", _mean_size),
    "most probable effect = true": ("effect", lambda lines: rate(most_probable_effect(x) == x["label"] for x in lines)),
    "effect at work: named first": ("effect", lambda lines: rate(first(line) == line["label"] for line in lines)),
    "effect at work: confident wrong name": ("effect", lambda lines: rate(map(confidently_wrong, lines))),
    "effect at work: none": ("effect", lambda lines: rate(line["answer"] == NONE for line in lines)),
    "effect at work: unknown": ("effect", lambda lines: rate(line["answer"] == UNKNOWN for line in lines)),
    "effect at work: a cause that is not": ("effect", lambda lines: rate(map(one_too_many, lines))),
    "no effect: one blamed": ("none", lambda lines: rate(map(named, lines))),
    "no effect: unknown": ("none", lambda lines: rate(line["answer"] == UNKNOWN for line in lines)),
    "outside: unknown": ("outside", lambda lines: rate(line["answer"] == UNKNOWN for line in lines)),
    "outside: confident wrong name": ("outside", lambda lines: rate(map(confidently_wrong, lines))),
    "outside: none": ("outside", lambda lines: rate(line["answer"] == NONE for line in lines)),
    "calibration error of 'at work'": ("none effect", calibration),
    "at work, of those that are with 0.9 or more": ("none effect", surely_at_work),
    "ECE of the probabilities": (
        "none effect outside",
        lambda lines: _of_the_surest(lines, expected_calibration_error),
    ),
    "the same, by chance alone": (
        "none effect outside",
        lambda lines: _of_the_surest(lines, lambda confidence, _: error_by_chance(confidence)),
    ),
    "mean log probability of the truth": ("none effect outside", log_score),
    "amplitude intervals that cover": ("effect", lambda lines: rate(intervals_that_cover(lines))),
    "error of the shrinkage predicted of a motion held out": (
        "effect",
        lambda lines: _shrinkage_error(lines, "other_motion_deg"),
    ),
    "error of the predicted shrinkage: median, 90 %": ("effect", _shrinkage_error),
}
"""Each measure with the kinds of labels it is computed for."""


def measure_table(by_condition: dict[str, list[Line]]) -> str:
    """Tabulate the measures of all conditions except `loo`, the power curve and the conditions with one candidate.

    The latter appear as rows: how often the effect is found where it is the only candidate.
    """
    apart = ("loo", "power_", ALONE)
    chosen = {c: lines for c, lines in by_condition.items() if not c.startswith(apart)}
    alone = {c: by_condition.get(ALONE + c, []) for c in chosen}
    rows = [
        [name, *(measure(_of_kind(lines, *kinds.split())) for lines in chosen.values())]
        for name, (kinds, measure) in MEASURES.items()
    ]
    rows[1:1] = [
        [COULD_BE_FOUND, *(rate(map(covered, lines)) for lines in alone.values())],
        [LESS_THAN_COULD, *(_points_less(lines, alone[c]) for c, lines in chosen.items())],
    ]
    rows.append([SHRINKAGE_ALONE, *map(_shrinkage_error, alone.values())])
    return markdown(["measure", "aim", *chosen], [[name, REACH.get(name, ""), *values] for name, *values in rows])


def _points_less(lines: list[Line], alone: list[Line]) -> str:
    """Format by how many percentage points fewer effects are found among all candidates than alone."""
    if not alone:
        return "-"
    both = [np.mean([covered(line) for line in one]) for one in (_of_kind(lines, "effect"), alone)]
    return f"{100 * (both[1] - both[0]):.1f}"


def _of_kind(lines: Iterable[Line], *kinds: str) -> list[Line]:
    return [line for line in lines if kind(line["label"]) in kinds]


def outcome_table(outcomes: Sequence[str], head: str, possible: Sequence[str]) -> str:
    """Tabulate the share of each outcome."""
    rows = [[one, rate(found == one for found in outcomes)] for one in possible if one in outcomes]
    return markdown([head, "share"], rows)


def confusion_matrix(lines: Sequence[Line]) -> str:
    """Tabulate truth (rows) against the first name of the answer (columns); listed effects appear by number."""
    columns = [*CAUSES, NONE, UNKNOWN]
    counts = Counter((line["label"], first(line)) for line in lines)
    outside = sorted({line["label"] for line in _of_kind(lines, "outside")})
    numbers = {name: str(number) for number, name in enumerate(CAUSES, 1)}
    present = [label for label in (*CAUSES, NONE, *outside) if any(line["label"] == label for line in lines)]
    rows = [
        [f"{numbers.get(row, '')} {row}".strip(), *(str(counts[row, column] or "") for column in columns)]
        for row in present
    ]
    return markdown(["truth", *(numbers.get(column, column) for column in columns)], rows)


MIMICRY = "gap on a motion that nobody saw, deg"


def mimicry_table(left_out: Sequence[Line], whole: Sequence[Line]) -> str:
    """Tabulate how well wrong and confident wrong names predict the held-out motion, beside the right names."""
    columns = {"a wrong name": left_out, "a confident one": [line for line in left_out if confidently_wrong(line)]}
    found = {head: mimicry(lines, whole) for head, lines in columns.items()}
    shown = {f"{head} ({len(gaps_deg)})": gaps_deg.T for head, gaps_deg in found.items() if len(gaps_deg)}
    rows = [
        ["adapted, mean", *(f"{adapted.mean():.3f}" for adapted, _, _ in shown.values())],
        ["with the effect at work, mean", *(f"{right.mean():.3f}" for _, right, _ in shown.values())],
        ["with what was named in its place, mean", *(f"{wrong.mean():.3f}" for _, _, wrong in shown.values())],
        ["more than with the effect at work, median", *(f"{np.median(b - a):.3f}" for _, a, b in shown.values())],
        ["more than with the effect at work, most", *(f"{(b - a).max():.3f}" for _, a, b in shown.values())],
    ]
    return markdown([MIMICRY, *shown], rows)


POWER = {"power_0.25": 0.25, "half": 0.5, "standard": 1.0, "power_1.5": 1.5, "power_2": 2.0}
"""Sizes of the power curve, relative to the world's amplitudes."""


def power_table(by_condition: dict[str, list[Line]]) -> str:
    """Tabulate, by effect size, the share of cases in which the active effect is the first name of the answer."""
    by_size = {size: _of_kind(by_condition.get(condition, []), "effect") for condition, size in POWER.items()}

    def row(name: str, labels: Sequence[str]) -> list[str]:
        chosen = ([line for line in lines if line["label"] in labels] for lines in by_size.values())
        return [name, *(rate(first(line) == line["label"] for line in lines) for lines in chosen)]

    rows = [row(name, [name]) for name in LISTED]
    return markdown(["effect", *(f"size {size:g}" for size in by_size)], [*rows, row("all", LISTED)])


def report(lines: Sequence[Line]) -> str:
    """Write the report of the whole study as Markdown."""
    good = [line for line in lines if "failed" not in line]
    by_condition: dict[str, list[Line]] = {}
    for line in good:
        by_condition.setdefault(line["condition"], []).append(line)
    if not good:
        return "\n".join(["No finished case among those asked for.", *_failures(lines)])
    standard = by_condition.get("standard", [])
    parts = [_preamble(lines, good), "## By condition", measure_table(by_condition)]
    if pairs := _of_kind(standard, "pair"):
        possible = ("both named", "one named", UNKNOWN, NONE, "wrong")
        parts += ["## Two effects at once", outcome_table([pair_outcome(x) for x in pairs], "pairs", possible)]
    if left_out := by_condition.get("loo"):
        like = mimics(standard)
        possible = (UNKNOWN, "honest mimic", NONE, "wrong set", "confident wrong name")
        outcomes = [left_out_outcome(line, like) for line in left_out]
        parts += [
            "## The effect at work taken from the library",
            "A mimic is in one set of `indistinguishable` with the effect when the library holds it.",
            outcome_table(outcomes, "left out", list(dict.fromkeys([*possible, *outcomes]))),
        ]
        if len(mimicry(left_out, standard)):
            parts += [mimicry_table(left_out, standard)]
    if standard:
        parts += ["## Confusion matrix, standard", confusion_matrix(standard)]
    if any(condition in by_condition for condition in POWER):
        parts += ["## Named first, by size of the effect", power_table(by_condition)]
    singles = [line for line in good if line["condition"] != "loo"]
    if found := confusions(singles)[:_MOST_CONFUSIONS]:
        rows = [[f"{a} - {b}", str(beside), str(instead)] for a, b, beside, instead in found]
        header = ["at work - named", "beside it", "instead of it"]
        parts += ["## What is taken for what, all conditions but `loo`", markdown(header, rows)]
    return "\n\n".join(parts)


def _preamble(lines: Sequence[Line], good: Sequence[Line]) -> str:
    seeds, models = (sorted({line[name] for line in good}) for name in ("seed", "model"))
    text = [
        f"Simulated cases: {len(good)}, seeds {seeds[0]} to {seeds[-1]} ({len(seeds)}), parameter sets "
        f"{', '.join(models)}; median {np.median([line['seconds'] for line in good]):.0f} s a case. "
        "In brackets: 95 % interval (Wilson), and of how many."
    ]
    if len(states := Counter(line["code"] for line in lines)) > 1:
        counts = ", ".join(f"{state}: {n}" for state, n in states.most_common())
        text.append(f"**The cases come from {len(states)} states of the code ({counts}): not one study.**")
    return "\n".join([*text, *_failures(lines)])


def _failures(lines: Iterable[Line]) -> list[str]:
    failed = [f"- {key(line)}: {line['failed']}" for line in lines if "failed" in line]
    return [f"**{len(failed)} cases failed:**\n", *failed[:_MOST_FAILURES]] if failed else []
