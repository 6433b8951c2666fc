"""The report of a run: one HTML file that opens without a network, with figures to step, turn and choose from."""

from adapt.report.page import report_html

__all__ = ["report_html"]
