"""Sentences on which results may be used: the report says the same as ``girdle trust``, as far as it is known."""

from html import unescape

import numpy as np
from handmade import adaptations, motions_of, rising
from pages import R2

from adapt import adapt_subjects, assess_trust
from adapt.report import report_html
from adapt.tables.results import Tables
from adapt.trust.usable_results import flat_by_subject, quick_sentences, trust_sentences
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE

CLAUSE = "; the serratus was not checked: see girdle trust"


def test_an_adaptation_says_of_the_same_data_what_trust_says():
    """Check two subjects with a flat direction: all but the check of the serratus is the same."""
    motions = read_motions(DATA_FILE)
    motions = motions.select(np.isin(motions.subject, motions.subjects[:2]))
    found, result = assess_trust(motions, R2), adapt_subjects(motions, R2)
    flat = flat_by_subject(["R2"], motions.subjects, result.uncertainty)
    quick = quick_sentences(R2, result, flat)["R2"]
    *same, ellipsoid = trust_sentences(found.subjects)
    assert quick[:2] == same
    assert "M_y (2 of 2)" in quick[1]
    assert CLAUSE in quick[2]
    others = found.plausibility.query("verdict == 'warning' and not check.str.startswith('serratus')")
    outside = len(set(others["subject"]))
    assert (
        quick[2].replace(CLAUSE, "")
        == trust_sentences(found.subjects.assign(plausibility=["warning"] * outside + ["pass"] * (2 - outside)))[2]
    )
    assert ellipsoid.startswith("Ellipsoid: ")


def test_without_covariances_the_report_says_what_is_at_a_bound_and_where_to_see_the_rest():
    motions = motions_of(rising(2, 4))
    made = adaptations(motions, R2)
    said = "M_y and A_y trade off: see girdle trust."
    parameters = made.parameters.assign(A_y_mm_at_bound=[1, 0])
    bare = Tables(made.fits, parameters, made.heldout, made.subjects)
    assert quick_sentences(R2, bare, None)["R2"][1] == f"Parameters: do not read A_y (1 of 2): at a bound; {said}"
    pages = [unescape(report_html(motions, R2, one)) for one in (bare, made)]
    assert [said in page for page in pages] == [True, False], "the other has its covariances"
    assert "Parameters: all are determined." in pages[1]
