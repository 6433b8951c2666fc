"""Studies of the library, by question; docs/research/README.md has the results.

    named_causes    how often is the diagnosis right, and do its causes predict measured shoulders?
    thesis          which results of Kaptein's thesis are reproduced, and how are its cadavers completed?
    trust           do intervals, held-out gaps and limits of `girdle trust` hold?
    person          does a person's own parameter set fit better than a cadaver's?
    speed           how fast are the fits, beside other solvers and the peak performance of the machine?

The library does not import the studies. `make studies` runs their tests (``tests``); `make test` runs those tests that
guard the library.
"""
