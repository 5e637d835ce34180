"""Studies: result rows -> tables, figures, a document, status. Only `figures` and its command need torch."""
