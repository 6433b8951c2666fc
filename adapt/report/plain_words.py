"""Plain names of the causes and meanings of terms, for readers of the page who do not know the project."""

import re

from markupsafe import Markup, escape

from models.effects import EFFECTS
from models.effects.effect import cause_of

_PLAIN_NAMES = {effect.cause: effect.plain_name for effect in EFFECTS.values() if effect.plain_name}
"""Plain names by cause; an effect from outside the library has only its own name."""

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
    "held out": "of motions, postures or persons that the numbers were not fitted to",
    "own bones": "bone lengths, attachments and frames of a person, adapted as far as people differ",
    "active": "said of an effect that acts in these people; its probability is the inclusion probability",
    "credible set": "the causes that may stand in one place, with 95 % probability together",
    "noise alone": "what would be left if the model were right and the measurement had this noise",
}

_TERM = re.compile(rf"(?<![\\w-])({'|'.join(sorted(map(re.escape, GLOSSARY), key=len, reverse=True))})(?![\\w-])")

_IDENTIFIER = re.compile(r"\b[a-z]+(?:_[a-z]+)+\b")


def explained(name: str, what: str) -> Markup:
    """Write a candidate's plain name with its description on hover and focus, and its identifier beside it."""
    cause = cause_of(name)
    if cause not in _PLAIN_NAMES:
        return Markup("<code>{}</code>").format(name)
    plain = Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(what, _PLAIN_NAMES[cause])
    return plain + Markup(" <code>{}</code>").format(name)


def with_hover(text: str) -> Markup:
    """Mark up a sentence: on hover and focus, identifiers show their plain names and glossary terms their meanings."""

    def one(found: re.Match[str]) -> str:
        name = found.group()
        if name not in _PLAIN_NAMES:
            return name
        return str(Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(_PLAIN_NAMES[name], name))

    def term(found: re.Match[str]) -> str:
        return str(Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(GLOSSARY[found.group()], found.group()))

    parts = _IDENTIFIER.split(str(escape(text)))  # escaping leaves identifiers and terms as they are
    between = [_TERM.sub(term, part, count=1) for part in parts]
    named = [one(found) for found in _IDENTIFIER.finditer(str(escape(text)))]
    return Markup("".join(word for pair in zip(between, [*named, ""], strict=True) for word in pair))
