"""Do the intervals, the held-out gaps and the limits of `girdle trust` hold?"""
