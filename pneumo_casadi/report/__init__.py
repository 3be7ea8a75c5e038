"""Reports: text, figures, HTML."""
