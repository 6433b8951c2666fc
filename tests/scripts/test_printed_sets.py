"""The shipped sets of the thesis against its tables, which were typed a second time for this test."""

import numpy as np

from adapt.trust.thesis import printed
from models import load_model
from scripts.research.thesis import scores


def test_the_conclusions_of_the_thesis_follow_from_its_tables():
    """6.4: the scapula's mean from 7.2 to 3.8, its max from 28.5 to 10.2. Table 6.6 has the shipped parameters."""
    before, after = printed.gaps_deg(adapted=False), printed.gaps_deg(adapted=True)
    assert [round(float(x[:, 3:].mean()), 1) for x in (before, after)] == [7.2, 3.8]
    assert [float(x[:, 3:].max()) for x in (before, after)] == [28.5, 10.2]
    assert (before.shape, scores.published_shrunk()) == ((3, 6, 10), 126 / 180)
    own = np.array([load_model(name).girdle.adapted_mm for name in printed.SETS])
    np.testing.assert_allclose(printed.own_mm(), own, rtol=0.0, atol=0.5)
