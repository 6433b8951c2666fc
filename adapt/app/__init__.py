"""A local page in the browser, ``girdle app``: files in, what was read, adaptation and diagnosis, everything as a zip."""
