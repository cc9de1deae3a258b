"""Tables and figures of papers beside the same recomputed: files that describe them, and what reads and judges them."""

from reports.papers.items import names, read
from reports.papers.pages import write
from reports.papers.terminal import show

__all__ = ["names", "read", "show", "write"]
