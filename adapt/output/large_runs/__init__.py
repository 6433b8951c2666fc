"""Runs of any number of subjects: in chunks, resumable, in one process, in several, or on a Dask cluster."""
