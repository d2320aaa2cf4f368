"""Pages to look at runs and studies with: single HTML files that open without a network."""

from mcstudy.viewer.content import Curve, ViewedRun, pack_run
from mcstudy.viewer.explorer import Column, Stored, render_explorer
from mcstudy.viewer.page import render_viewer

__all__ = ["Column", "Curve", "Stored", "ViewedRun", "pack_run", "render_explorer", "render_viewer"]
