"""Plain names of the causes, and the words of the field, for a reader of the page who does not know the project."""

import re

from markupsafe import Markup, escape

from models.effects import EFFECTS
from models.effects.amplitudes import THORAX_POINTS, THORAX_POINTS_WHAT
from models.effects.effect import cause_of

PLAIN_NAMES = {
    "clavicle_axial_estimate": "axial rotation of the clavicle estimated, not measured",
    "clavicle_frame_bias": "clavicle frame turned",
    "scapula_landmark_bias": "scapula frame turned",
    "skin_artefact": "skin marker lags the scapula",
    "thorax_extension": "thorax bends with the arm",
    "clavicle_length": "clavicle of another length",
    "scapula_size": "scapula of another size",
    "sc_offset": "SC joint elsewhere on the thorax",
    "clavicle_conoid_offset": "conoid attached elsewhere on the clavicle",
    "scapula_conoid_offset": "conoid attached elsewhere on the scapula",
    "ts_offset": "TS elsewhere on the scapula",
    "ai_offset": "AI elsewhere on the scapula",
    "ts_distance_offset": "TS at another distance from the thorax",
    "ai_distance_offset": "AI at another distance from the thorax",
    "ac_translation": "AC joint moves",
    "conoid_strain": "conoid stretches",
    "sc_translation": "SC joint moves",
    "scapulothoracic_gap": "scapula lifts off the thorax",
    "thorax_asymmetry": "thorax beside the midline",
    "thorax_shape": "thorax is no ellipsoid",
    "thorax_tilt": "thorax ellipsoid tilted",
    THORAX_POINTS: "thorax of another person",
}
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
    "unseen": "of motions, postures or persons that the numbers were not fitted to",
    "noise alone": "what would be left if the model were right and the measurement had this noise",
}

_IDENTIFIER = re.compile(r"\b[a-z]+(?:_[a-z]+)+\b")


def explained(name: str) -> Markup:
    """Write a candidate's plain name with its description on hover and focus, and its identifier beside it."""
    cause = cause_of(name)
    if cause not in PLAIN_NAMES:
        return Markup("<code>{}</code>").format(name)
    plain = Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(_what(name), PLAIN_NAMES[cause])
    return plain + Markup(" <code>{}</code>").format(name)


def with_hover(text: str) -> Markup:
    """Give every identifier in a sentence its plain name on hover and focus."""

    def one(found: re.Match[str]) -> str:
        name = found.group()
        if name not in PLAIN_NAMES:
            return name
        return str(Markup('<abbr tabindex="0" title="{}">{}</abbr>').format(PLAIN_NAMES[name], name))

    return Markup(_IDENTIFIER.sub(one, str(escape(text))))  # escaped first; identifiers have no marks


def _what(name: str) -> str:
    if name == THORAX_POINTS:
        return THORAX_POINTS_WHAT
    return EFFECTS[name].what if name in EFFECTS else ""
