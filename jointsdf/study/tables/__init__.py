"""Tables of the rows, each a builder that returns numbers for CSV and cells for LaTeX."""
