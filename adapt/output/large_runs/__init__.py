"""Runs of any number of subjects: in parts, resumable, in one process, in several, or on a Dask cluster."""
