"""Effects made for tests from those of the library."""

from dataclasses import replace

from models.effects import Effect


def without_details(effect: Effect) -> Effect:
    """The effect in its directions alone: for angles, as what shows landmarks may need the details."""
    count = len(effect.directions)
    return replace(
        effect,
        channels=effect.channels[:count],
        prior=replace(effect.prior, scale=effect.prior.scale[:count]),
        details=0,
    )
