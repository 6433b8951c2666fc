"""Local page in the browser, ``girdle app``: upload files, see what was read, adapt and diagnose, download a zip."""
