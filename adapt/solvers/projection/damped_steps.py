"""Loop of damped steps of many groups side by side: each group has its own damping and ends on its own."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from adapt.engine.batching import take_problems, with_problems

_FEW = 0.75
"""Share of unfinished groups below which these go on without the finished ones: the separation costs a copy."""

STUCK = 0.1
"""Damping above which a step is short because of the damping, not because of convergence."""


_GOOD, _POOR, _MORE_AFTER_POOR = 0.75, 0.25, 2.0
"""Two ratios of actual to predicted decrease, as in trust-region methods (More 1978), and a factor on the damping.
After a step below the first ratio the damping stays the same, below the second ratio the factor increases it."""


class Damping(NamedTuple):
    """Rule for the damping of a group from step to step."""

    less: float
    """Factor after a step down; below ``least`` the damping becomes 0."""
    more: float
    """Factor after a step up."""
    least: float
    least_after_failure: float
    hopeless: float
    """Damping above which a group cannot descend, as at a wall, and ends."""

    def after(
        self,
        damping: Float[np.ndarray, " groups"],
        better: Bool[np.ndarray, " groups"],
        share: Float[np.ndarray, " groups"] | float = 1.0,
    ) -> Float[np.ndarray, " groups"]:
        """Compute the damping of the next step. ``share``: ratio of actual to predicted decrease of a step."""
        less = damping * self.less * (damping > self.least)
        poor = np.maximum(damping * _MORE_AFTER_POOR, self.least_after_failure)
        after_down = np.where(share > _GOOD, less, np.where(share > _POOR, damping, poor))
        return np.where(better, after_down, np.maximum(damping * self.more, self.least_after_failure))


Steps = tuple[Any, Any, Any]
"""State of all groups: trees of arrays with the rows, the problems or the groups as their last axis. The tree of the
groups has ``going``: True where a group has not ended."""


def until_ended(objective: Any, steps: Steps, step: Callable[[Any, Steps], Steps], most_steps: int) -> Steps:
    """Take at most ``most_steps`` steps; once enough groups have ended, the others go on without them.

    ``objective``: function that the steps minimise, with its ``problems``; its method ``of`` selects groups.
    """
    while most_steps and (going := steps[-1].going).any():
        if going.mean() <= _FEW:
            problems = going[objective.problems.group]
            places = problems[objective.problems.problem], problems, going
            some = tuple(map(take_problems, steps, places))
            others = until_ended(objective.of(going), some, step, most_steps)
            return tuple(map(with_problems, steps, map(np.flatnonzero, places), others))
        steps, most_steps = step(objective, steps), most_steps - 1
    return steps
