"""Landmarks that a cluster of markers carries from static trials, where they were palpated, into a moving one."""
