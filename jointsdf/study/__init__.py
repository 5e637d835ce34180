"""Studies: result rows -> tables, figures, a document, status. No torch outside `figures`."""
