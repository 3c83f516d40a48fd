"""The report: one page of HTML for the paper, one for the studies."""
