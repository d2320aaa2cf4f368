"""Pages to look at runs and studies with: single HTML files that open without a network."""

from mcstudy.viewer.content import Curve, ViewedRun
from mcstudy.viewer.explorer import Column, render_explorer
from mcstudy.viewer.page import render_viewer

__all__ = ["Column", "Curve", "ViewedRun", "render_explorer", "render_viewer"]
