"""Pictures of runs: one HTML file that plays in any browser, and PNG and GIF."""
