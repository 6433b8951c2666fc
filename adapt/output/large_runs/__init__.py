"""Any number of subjects: in parts, resumed, in this process or on a Dask cluster."""
