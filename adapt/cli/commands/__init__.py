"""The commands of ``girdle``, a module a group."""
