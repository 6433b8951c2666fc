"""Adaptation with own bones: bones and measured frames of each person, within the variation between people."""
