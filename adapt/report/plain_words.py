"""Plain names of the causes, and the words of the field, for a reader of the page who does not know the project."""

import re

from markupsafe import Markup, escape

from models.effects import EFFECTS
from models.effects.effect import cause_of

_PLAIN_NAMES = {effect.cause: effect.plain_name for effect in EFFECTS.values() if effect.plain_name}
"""By cause. An effect from elsewhere has its own name alone."""

GLOSSARY = {
    "SC, AC": "the joints at the two ends of the clavicle: with the sternum, with the acromion of the scapula",
    "TS, AI": "two landmarks of the scapula (trigonum spinae, angulus inferior); their distance to the thorax is kept",
    "conoid": "a ligament between clavicle and scapula; the model keeps its length",
    "protraction": "turning forward about the vertical axis",
    "lateral rotation": "the lower angle of the scapula swings outward, as the arm is raised",
    "tipping": "tilting of the scapula about its spine; backward is positive",
    "gap": "mean absolute difference between simulated and measured angles, degrees",
    "adaptation": "ellipsoid and conoid length are changed until the model comes closest to this person",
    "prior thorax points": "points on the thorax that the parameter set has, another person's",
    "unseen": "of motions, postures or persons that the numbers were not fitted to",
    "noise alone": "what would be left if the model were right and the measurement had this noise",
}

_IDENTIFIER = re.compile(r"\b[a-z]+(?:_[a-z]+)+\b")


def explained(name: str) -> Markup:
    """Write a candidate's plain name with its description on hover and focus, and its identifier beside it."""
    cause = cause_of(name)
    if cause not in _PLAIN_NAMES:
        return Markup("<code>{}</code>").format(name)
    what = EFFECTS[name].what if name in EFFECTS else ""
    plain = Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(what, _PLAIN_NAMES[cause])
    return plain + Markup(" <code>{}</code>").format(name)


def with_hover(text: str) -> Markup:
    """Give every identifier in a sentence its plain name on hover and focus."""

    def one(found: re.Match[str]) -> str:
        name = found.group()
        if name not in _PLAIN_NAMES:
            return name
        return str(Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(_PLAIN_NAMES[name], name))

    return Markup(_IDENTIFIER.sub(one, str(escape(text))))  # escaped first; identifiers have no marks
