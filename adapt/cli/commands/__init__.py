"""Commands of ``girdle``: modules with options and help, and modules that run the commands."""
