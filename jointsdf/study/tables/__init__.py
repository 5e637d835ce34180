"""Tables of the rows, as CSV and LaTeX."""
