"""Plain names of the causes and meanings of terms, for readers of the page who do not know the project."""

import re

from markupsafe import Markup, escape

from models.effects import EFFECTS
from models.effects.effect import cause_of

_PLAIN_NAMES = {effect.cause: effect.plain_name for effect in EFFECTS.values() if effect.plain_name}
"""Plain names by cause; an effect from outside the library has only its own name."""

GLOSSARY = {
    "SC": "the joint of the clavicle with the sternum",
    "AC": "the joint of the clavicle with the acromion of the scapula",
    "TS": "a landmark of the scapula, trigonum spinae; its distance to the thorax is kept",
    "AI": "a landmark of the scapula, angulus inferior; its distance to the thorax is kept",
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

_HYPHEN = {term.replace(" ", "-"): term for term in GLOSSARY if " " in term}
"""Terms as they stand before a noun: 'held-out motions'."""

_WORDS = sorted({*GLOSSARY, *_HYPHEN, *_PLAIN_NAMES}, key=len, reverse=True)

_MARKED = re.compile(rf"(?<![\w-])(?:{'|'.join(map(re.escape, _WORDS))})(?![\w-])")
"""Terms and causes in a text, each as a whole word."""


def explained(name: str, what: str) -> Markup:
    """Write a candidate's plain name with its description on hover and focus, and its identifier beside it."""
    cause = cause_of(name)
    if cause not in _PLAIN_NAMES:
        return Markup("<code>{}</code>").format(name)
    plain = Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(what, _PLAIN_NAMES[cause])
    return plain + Markup(" <code>{}</code>").format(name)


def with_hover(text: str) -> Markup:
    """Mark up a sentence: on hover and focus, identifiers show their plain names and glossary terms their meanings.

    Every identifier is marked, and every term where it stands first.
    """
    marked = set()

    def one(found: re.Match[str]) -> str:
        word = found.group()
        term = _HYPHEN.get(word, word)
        if term in marked:
            return word
        if term in GLOSSARY:
            marked.add(term)
        title = GLOSSARY.get(term) or _PLAIN_NAMES[term]
        return str(Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(title, word))

    return Markup(_MARKED.sub(one, str(escape(text))))  # escaping leaves identifiers and terms as they are
