"""Studies of the library, by question; docs/research/README.md has what came out.

    named_causes    how often is the diagnosis right, and do its causes predict measured shoulders?
    thesis          what of Kaptein's thesis comes out again, and how are its cadavers completed?
    trust           do intervals, held-out gaps and limits of `girdle trust` hold?
    person          does a person's own parameter set fit better than a cadaver's?
    speed           how fast are the fits, beside other solvers and what the machine can reach?

Nothing that runs imports them. `make studies` runs their tests (``tests``); `make test` what guards the library.
"""
