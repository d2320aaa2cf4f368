"""Self-contained HTML reports."""

from mcstudy.report.document import Section, Table, render

__all__ = ["Section", "Table", "render"]
