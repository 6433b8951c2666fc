"""Report of a run: one HTML file that opens without a network, with interactive figures."""

from adapt.report.page import report_html

__all__ = ["report_html"]
