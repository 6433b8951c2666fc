"""Entry point of ``python -m adapt``: the command line without the installed script."""

from adapt.cli.entry import main

main()
