"""Plots to zoom and read off in a browser; they need Bokeh, the extra `interactive`."""
