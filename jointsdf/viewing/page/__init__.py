"""Pages that show runs to anyone with a browser: one self-contained HTML file, without server or network."""
