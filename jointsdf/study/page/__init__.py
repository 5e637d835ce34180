"""The page of a study, and the command that shows runs and studies in a browser."""
