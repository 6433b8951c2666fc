"""Types of difference between the attachments of two bones: the five types of the thesis (Table 5.3)."""

SMALL, LARGE, SLIDE, SHIFT, CROSS = "SMALL", "LARGE", "T1", "T2", "T3"
"""Types of difference: none; another place; slid along, or of another length; shifted across; crossed, or of another
direction."""

LEAST_MM, MEAN_MM, MOST_MM = 5.0, 7.0, 12.0
"""Limits of the smallest, mean and largest distance between two contours; a distance equal to its limit counts as below
it. The table prints < and >, which leave 5.0 open; Appendix D calls 5.0 small."""


def attachment_type(least_mm: float, mean_mm: float, most_mm: float) -> str | None:
    """Classify two attachment contours by the distances between them (Table 5.3).

    None for distances without a type in the table: a smallest distance above 5 mm with a mean below 7 mm and a largest
    above 12 mm. ValueError where the three distances are not in ascending order.
    """
    if not 0.0 <= least_mm <= mean_mm <= most_mm:
        raise ValueError(f"distances {least_mm:g}, {mean_mm:g}, {most_mm:g} are not in order")
    near, close, short = least_mm <= LEAST_MM, mean_mm <= MEAN_MM, most_mm <= MOST_MM
    if short:
        return SMALL if near and close else SHIFT
    if near:
        return SLIDE if close else CROSS
    return None if close else LARGE
