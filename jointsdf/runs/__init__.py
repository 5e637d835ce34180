"""Run folders and result rows: writing, locking, identity and reuse. Imports no torch."""
