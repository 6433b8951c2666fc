"""A local page in the browser, ``girdle app``: files in, what was read, adapt and diagnose, everything as a zip."""
