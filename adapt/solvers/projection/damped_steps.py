"""The loop of damped steps of many groups side by side: each has a damping of its own and ends on its own."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from adapt.engine.batching import take_problems, with_problems

_FEW = 0.75
"""Share of the groups below which those that are going on do so without the others: leaving them costs a copy."""

STUCK = 0.1
"""A step with more damping than this is short because it must be, not because it is the last."""


_GOOD, _POOR, _MORE_AFTER_POOR = 0.75, 0.25, 2.0
"""Shares of the decrease that is expected, as of trust regions (More 1978): after a step that goes down by less than
the first the next is no longer, by less than the second it is shorter."""


class Damping(NamedTuple):
    """How the damping of a group goes along its steps."""

    less: float
    """Factor after a step down; below ``least`` it is 0."""
    more: float
    """After a step up."""
    least: float
    least_after_failure: float
    hopeless: float
    """A group that needs more stands at a wall: it ends there."""

    def after(
        self,
        damping: Float[np.ndarray, " groups"],
        better: Bool[np.ndarray, " groups"],
        share: Float[np.ndarray, " groups"] | float = 1.0,
    ) -> Float[np.ndarray, " groups"]:
        """Give the damping of the next step. ``share``: what a step went down of what was expected of it."""
        less = damping * self.less * (damping > self.least)
        poor = np.maximum(damping * _MORE_AFTER_POOR, self.least_after_failure)
        after_down = np.where(share > _GOOD, less, np.where(share > _POOR, damping, poor))
        return np.where(better, after_down, np.maximum(damping * self.more, self.least_after_failure))


Steps = tuple[Any, Any, Any]
"""Where all groups are: trees of arrays with the rows, the parts or the groups as their last axis. Those of the groups
say which are ``going``, not at their end yet."""


def until_ended(objective: Any, steps: Steps, step: Callable[[Any, Steps], Steps], most_steps: int) -> Steps:
    """Take at most so many steps; once enough groups have ended the others go on without them.

    ``objective``: what the steps go down on, with its ``parts``; ``of`` takes some of its groups.
    """
    while most_steps and (going := steps[-1].going).any():
        if going.mean() <= _FEW:
            parts = going[objective.parts.group]
            places = parts[objective.parts.part], parts, going
            some = tuple(map(take_problems, steps, places))
            others = until_ended(objective.of(going), some, step, most_steps)
            return tuple(map(with_problems, steps, map(np.flatnonzero, places), others))
        steps, most_steps = step(objective, steps), most_steps - 1
    return steps
