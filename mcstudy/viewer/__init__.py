"""A viewer of runs in three dimensions: one HTML file that opens without a network."""

from mcstudy.viewer.content import Curve, ViewedRun
from mcstudy.viewer.page import render_viewer

__all__ = ["Curve", "ViewedRun", "render_viewer"]
